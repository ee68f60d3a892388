"""Whether a component has what its contract asks for."""

from typing import Any


def members_of(contract: type) -> tuple[list[str], list[str]]:
    """Names of the members a contract asks for, and of those that are optional because it has a default for them."""
    required, optional = [], []
    for name in contract.__annotations__:
        (optional if name in vars(contract) else required).append(name)
    for name, member in vars(contract).items():
        if name.startswith("_") or name in contract.__annotations__:
            continue
        has_default = hasattr(contract, "__abstractmethods__") and contract.__abstractmethods__
        (optional if has_default and not getattr(member, "__isabstractmethod__", False) else required).append(name)
    return required, optional


def require_contract(component: Any, contract: type, *, optional: bool = False) -> None:
    """Check that a component, or its class, has the members of a contract.

    Args:
        optional: whether what the contract has a default for has to be there too, as in a class that inherits from it.

    Raises:
        ValueError: naming the component, what it lacks, and the contract.
    """
    required, others = members_of(contract)
    fields = getattr(component, "__dataclass_fields__", {})
    wanted = (*required, *(others if optional else ()))
    missing = [name for name in wanted if not (hasattr(component, name) or name in fields)]
    if missing:
        owner = component if isinstance(component, type) else type(component)
        hint = "; inherit from it to have what is optional" if set(missing) & set(others) else ""
        where = f"{contract.__module__}.{contract.__name__}"
        raise ValueError(f"{owner.__name__} lacks {', '.join(missing)} of the contract {where}{hint}")

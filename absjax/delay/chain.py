"""Systems that restricted feedback makes linear, and two that are: a scalar one and a pendulum.

    x_1' = f_1(x_1) + x_2,  ...,  x_n' = f_n(x_1, ..., x_n) + u(t - h)

Source: Hoang 2014 (thesis), eq. 6.9, 6.20 and 6.37.
"""

from typing import Any, ClassVar, Protocol

import jax.numpy as jnp

from absjax.parameters import model, parameter


class Chain(Protocol):
    """What the predictor asks of a system: a class made by `absjax.parameters.model`."""

    title: ClassVar[str]
    """for tables and figures"""

    @property
    def order(self) -> int:
        """n."""
        ...

    def drift(self, x: Any) -> Any:
        """(f_1, ..., f_n), arrays (n,), of the state (n,); f_i depends on x_1 to x_i alone. Traceable, smooth."""
        ...


@model
class Scalar:
    """x' = c x + u(t - h): the wheel acceleration at a given XBS, c = -a mu' / v. Source: Hoang 2014, eq. 3.2."""

    title: ClassVar[str] = "scalar system"

    c: Any = parameter("c, 1/s", default=5.0)

    @property
    def order(self) -> int:
        """1."""
        return 1

    def drift(self, x):
        """(c x,)."""
        return self.c * x


@model
class Pendulum:
    """x_1' = x_2, x_2' = -a sin x_1 - b x_2 + u(t - h). Source: Hoang 2014, eq. 6.37."""

    title: ClassVar[str] = "pendulum"

    a: Any = parameter("a, 1/s^2", default=1.0)
    b: Any = parameter("b, 1/s", default=1.0)

    @property
    def order(self) -> int:
        """2."""
        return 2

    def drift(self, x):
        """(0, -a sin x_1 - b x_2)."""
        return jnp.stack([0.0 * x[0], -self.a * jnp.sin(x[0]) - self.b * x[1]])


@model
class Integrators:
    """A chain of integrators, f = 0 but for f_n = c x_1."""

    title: ClassVar[str] = "chain of integrators"

    length: int = 3
    c: Any = parameter("c, 1/s^n", default=0.0)

    def __post_init__(self):
        if self.length < 1:
            raise ValueError(f"Integrators.length = {self.length} must be >= 1")

    @property
    def order(self) -> int:
        """n."""
        return self.length

    def drift(self, x):
        """(0, ..., c x_1)."""
        return jnp.zeros_like(x).at[-1].set(self.c * x[0])


def field(chain: Chain, x, u: Any = 0.0):
    """x' (n,) under an input that has arrived."""
    return chain.drift(x) + jnp.concatenate([x[1:], jnp.reshape(jnp.asarray(u, x.dtype), 1)])

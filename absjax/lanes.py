"""Lanes: which leaves of a model carry them, how many there are, mapping over them, and stacking models into them.

Every parameter is one value, or an array with one leading axis more than its field declares: that axis counts lanes.
What has no such axis is shared by all of them.
"""

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from absjax.parameters import is_model


def lane_axes(tree: Any) -> Any:
    """Same structure as `tree`, with 0 at leaves that carry a leading axis of lanes and -1 elsewhere.

    A leaf carries lanes when it has one axis more than its field declares; a leaf outside a model is
    a scalar per lane.
    """

    def axes(node):
        if not is_model(node):
            return _axis(node, own=0)
        values = []
        for field in dataclasses.fields(node):
            value = getattr(node, field.name)
            if field.metadata.get("leaf"):
                values.append(jax.tree.map(partial(_axis, own=field.metadata["ndim"]), value))
            elif field.metadata.get("part"):
                values.append(lane_axes(value))
        _, treedef = jax.tree.flatten(node, is_leaf=lambda child: child is not node)
        return jax.tree.unflatten(treedef, values)

    return jax.tree.map(axes, tree, is_leaf=is_model)


def _axis(leaf, own: int) -> int:
    return 0 if jnp.ndim(leaf) > own else -1


def mapped(axes: Any) -> Any:
    """`lane_axes` as `jax.vmap` takes them."""
    return jax.tree.map(lambda axis: None if axis < 0 else 0, axes)


def lane_count(tree: Any, name: str, lanes: int | None = None) -> int | None:
    """Number of lanes of a tree, None without any.

    Args:
        name: of the tree, for messages.
        lanes: those that others have.

    Raises:
        ValueError: if leaves have different numbers of lanes, or others have another; names the leaf.
    """
    for (path, leaf), axis in zip(jax.tree_util.tree_leaves_with_path(tree), jax.tree.leaves(lane_axes(tree))):
        if axis < 0:
            continue
        size = jnp.shape(leaf)[0]
        if lanes is not None and size != lanes:
            where = name + jax.tree_util.keystr(path)
            raise ValueError(f"{where} has {size} lanes, others have {lanes}; all ensembles must have one size")
        lanes = size
    return lanes


def over_lanes(function: Callable, model: Any, *arguments: Any) -> Any:
    """`function(model, *arguments)` for every lane; each leaf of the arguments has a leading axis of lanes."""
    return jax.vmap(function, in_axes=(mapped(lane_axes(model)), *(0 for _ in arguments)))(model, *arguments)


def each_lane(function: Callable, model: Any, *arguments: Any) -> Any:
    """The same, or `function` as it is where the arguments are of one lane: scalars."""
    if jnp.ndim(jax.tree.leaves(arguments)[0]) == 0:
        return function(model, *arguments)
    return over_lanes(function, model, *arguments)


def stacked(models: Sequence[Any]) -> Any:
    """Models of one structure as the lanes of one."""
    return jax.tree.map(lambda *leaves: np.stack([np.asarray(leaf, float) for leaf in leaves]), *models)


def chosen(models: Sequence[Any], index: Any) -> Any:
    """The lanes of one, lane k like `models[index[k]]`; what is alike in all of them is shared.

    Raises:
        ValueError: if the models are not of one structure.
    """

    def of_lanes(*leaves):
        values = [np.asarray(leaf, float) for leaf in leaves]
        alike = all(np.array_equal(value, values[0]) for value in values)
        return leaves[0] if alike else np.stack(values)[np.asarray(index)]

    if len({jax.tree.structure(model) for model in models}) > 1:
        raise ValueError("models of different structure cannot be lanes of one")
    return jax.tree.map(of_lanes, *models)


def taken(model: Any, index: Any) -> Any:
    """A model with some of its lanes: one, or an array of them."""
    return jax.tree.map(lambda leaf, axis: leaf if axis < 0 else leaf[index], model, lane_axes(model))


def repeated(model: Any, times: int) -> Any:
    """A model with every lane so many times in a row."""
    return jax.tree.map(
        lambda leaf, axis: leaf if axis < 0 else jnp.repeat(leaf, times, axis=0), model, lane_axes(model)
    )


def of_each_lane(function: Callable, model: Any, *arguments: Any) -> Any:
    """The same where lanes may be the model's alone: arguments that are scalars are then shared by all of them."""
    lanes = lane_count(arguments, "arguments", lane_count(model, "model"))
    if lanes is not None:
        arguments = tuple(jnp.broadcast_to(x, (lanes,)) for x in arguments)
    return each_lane(function, model, *arguments)

"""An ensemble in tiles of lanes, shared out over the local devices."""

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.sharding import Mesh, PartitionSpec


def over_tiles(run_tile, axes, lanes: int, tile: int):
    """Cut the lanes into tiles, map over them, and share the tiles out over the local devices."""
    if lanes <= tile:
        return run_tile
    devices = np.array(jax.local_devices())
    per_device = -(-lanes // (tile * devices.size))
    padded = tile * devices.size * per_device

    # Tiles are dealt out to the devices in turn, so that each gets its share of the long ones.
    def deal(leaf):
        leaf = jnp.concatenate([leaf, jnp.broadcast_to(leaf[-1:], (padded - lanes, *leaf.shape[1:]))])
        return leaf.reshape(per_device, devices.size, tile, *leaf.shape[1:]).swapaxes(0, 1).reshape(leaf.shape)

    def collect(leaf):
        tiles = leaf.reshape(devices.size, per_device, tile, *leaf.shape[1:])
        return tiles.swapaxes(0, 1).reshape(leaf.shape)[:lanes]

    def on_device(system, state, mode):
        def cut(leaf):
            return leaf.reshape((per_device, tile) + leaf.shape[1:])

        leaves, treedef = jax.tree.flatten(system)
        batched = [axis >= 0 for axis in jax.tree.leaves(axes)]
        moving = [cut(leaf) for leaf, many in zip(leaves, batched) if many]

        def one(args):
            moving, state, mode = args
            values = iter(moving)
            whole = treedef.unflatten([next(values) if many else leaf for leaf, many in zip(leaves, batched)])
            return run_tile(whole, state, mode)

        result = lax.map(one, (moving, *jax.tree.map(cut, (state, mode))))
        return jax.tree.map(lambda leaf: leaf.reshape((-1,) + leaf.shape[2:]), result)

    def run(system, state, mode):
        system = jax.tree.map(lambda leaf, axis: leaf if axis < 0 else deal(leaf), system, axes)
        state, mode = jax.tree.map(deal, (state, mode))
        over = PartitionSpec("lanes")
        specs = jax.tree.map(lambda axis: PartitionSpec() if axis < 0 else over, axes)
        program = on_device
        if devices.size > 1:
            mesh = Mesh(devices, ("lanes",))
            program = jax.shard_map(on_device, mesh=mesh, in_specs=(specs, over, over), out_specs=over, check_vma=False)
        return jax.tree.map(collect, program(system, state, mode))

    return run

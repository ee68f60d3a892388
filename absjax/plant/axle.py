"""What the wheels of a vehicle share: the slip behind the relaxation of the tyre.

    sigma l' = (R w - v) - |v| l,    Fx = Fz mu(l)

Without relaxation l = (R w - v) / v. Source: Aguado-Rojas 2019, section 3.6; Pacejka 2012, section 7.
"""

import jax.numpy as jnp


def relaxing(length, over_ground, sliding, slip):
    """dl/dt [1/s] of a relaxed slip l.

    Args:
        length: sigma, relaxation length [m].
        over_ground: v, speed over the ground along the wheel [m/s].
        sliding: speed at which the tyre slides over the ground, R w - v or -wy [m/s].
        slip: l.
    """
    return (sliding - jnp.abs(over_ground) * slip) / length

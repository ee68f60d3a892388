"""Double precision for the whole suite, and two CPU devices, so that sharing out over devices is tested."""

import jax

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_num_cpu_devices", 2)

"""Builds the optional C kernels; all else about the package stands in pyproject.toml.

A kernel that doesn't compile is left out. The environment's KERNEL_FLAGS go to compiler and linker
after all other flags, such as those of a sanitizer; a kernel that doesn't compile is then an error.
"""

import glob
import os
import sysconfig

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

FOLDER = "mocapidx/kernels"
FLAGS = {
    # NumPy neither fuses a multiplication with an addition nor reorders sums: nor may the kernels.
    "unix": ["-std=c11", "-O3", "-g0", "-ffp-contract=off", "-fvisibility=hidden"],
    "msvc": ["/O2", "/fp:precise", "/std:c11"],
}
OWN_FLAGS = os.environ.get("KERNEL_FLAGS", "").split()
# One library for all versions of Python from 3.11 on, which one without a global lock can't load.
LIMITED = not sysconfig.get_config_var("Py_GIL_DISABLED")


class BuildKernels(build_ext):
    """Compile with the flags that keep the bits; go on without a compiler."""

    def build_extensions(self):
        """Give each kernel the flags of the compiler that was found."""
        for extension in self.extensions:
            extension.extra_compile_args = FLAGS.get(self.compiler.compiler_type, []) + OWN_FLAGS
            extension.extra_link_args = OWN_FLAGS
        super().build_extensions()


setup(
    ext_modules=[
        Extension(
            f"mocapidx.kernels._{os.path.basename(source)[:-2]}",
            [source],
            depends=sorted(glob.glob(f"{FOLDER}/*.h")),
            define_macros=[("Py_LIMITED_API", "0x030B0000")] if LIMITED else [],
            py_limited_api=LIMITED,
            optional=not OWN_FLAGS,
        )
        for source in sorted(glob.glob(f"{FOLDER}/*.c"))
    ],
    cmdclass={"build_ext": BuildKernels},
    options={"bdist_wheel": {"py_limited_api": "cp311"}} if LIMITED else {},
)

"""Builds the optional C kernels; all else about the package stands in pyproject.toml."""

import glob
import os

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

FOLDER = "mocapidx/kernels"
FLAGS = {
    # NumPy neither fuses a multiplication with an addition nor reorders sums: nor may the kernels.
    "unix": ["-std=c11", "-O3", "-ffp-contract=off", "-fvisibility=hidden"],
    "msvc": ["/O2", "/fp:precise", "/std:c11"],
}


class BuildKernels(build_ext):
    """Compile with the flags that keep the bits; go on without a compiler."""

    def build_extensions(self):
        """Give each kernel the flags of the compiler that was found."""
        flags = FLAGS.get(self.compiler.compiler_type, [])
        for extension in self.extensions:
            extension.extra_compile_args = flags + os.environ.get("KERNEL_FLAGS", "").split()
            extension.extra_link_args = os.environ.get("KERNEL_FLAGS", "").split()
        super().build_extensions()


setup(
    ext_modules=[
        Extension(
            f"mocapidx.kernels._{os.path.basename(source)[:-2]}",
            [source],
            depends=sorted(glob.glob(f"{FOLDER}/*.h")),
            define_macros=[("Py_LIMITED_API", "0x030B0000")],
            py_limited_api=True,
            optional=True,
        )
        for source in sorted(glob.glob(f"{FOLDER}/*.c"))
    ],
    cmdclass={"build_ext": BuildKernels},
    options={"bdist_wheel": {"py_limited_api": "cp311"}},
)

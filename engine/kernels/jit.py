"""The one jit policy, and the private on-disk cache of compiled kernels.

Contract-only fastmath keeps NaN semantics and makes results independent of chunking and threads; numba's own cache
does not notice an edited callee in another file, so the cache folder is named by a hash of every kernel's source.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import llvmlite.binding as llvm
import numba
from numba.extending import overload

#: LLVM unrolls short loops of constant length completely before its vectoriser sees them, and a loop over the lanes
#: then stays scalar; with this limit they are vectorised (twice the pace of the march).
_LLVM_OPTIONS = ("--unroll-full-max-count=8",)


def kernel_hash() -> str:
    """SHA-256 over the kernels' sources, numba's and LLVM's versions and the processor: what the bits depend on."""
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.name.encode() + b"\0" + source.read_bytes() + b"\0")
    machine = (numba.__version__, llvm.llvm_version_info, platform.machine(), llvm.get_host_cpu_name(), _LLVM_OPTIONS)
    digest.update(repr(machine).encode())
    return digest.hexdigest()


def cache_folder() -> Path:
    """The private folder of the compiled kernels; WANDERLAST_CACHE or XDG_CACHE_HOME move it."""
    root = os.environ.get("WANDERLAST_CACHE") or os.path.join(
        os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache"), "wanderlast"
    )
    return Path(root) / f"kernels-{kernel_hash()[:20]}"


def _private(folder: Path) -> Path | None:
    """Make the folder for us alone, or None where that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        if folder.is_symlink() or folder.stat().st_uid != os.getuid():
            return None
        folder.chmod(0o700)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        return None


_FOLDER = _private(cache_folder()) or Path(tempfile.mkdtemp(prefix="wanderlast-kernels-"))
numba.config.CACHE_DIR = str(_FOLDER)  # type: ignore[attr-defined]
for _option in _LLVM_OPTIONS:
    llvm.set_option("wanderlast", _option)

_POLICY: dict[str, Any] = {"fastmath": {"contract"}, "error_model": "numpy", "nogil": True}


def kernel(function: Callable[..., None]) -> Callable[..., None]:
    """Compile a function by the project's policy, cached on disk."""
    return cast(Callable[..., None], numba.njit(cache=True, **_POLICY)(function))


def piece(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that kernels take into their own body."""
    return cast(Callable[..., Any], numba.njit(inline="always", **_POLICY)(function))


def chosen_for(stub: Callable[..., Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorate what picks, by the types of a call's arguments, the piece that stands for ``stub`` inside kernels."""
    return cast(Callable[[Callable[..., Any]], Callable[..., Any]], overload(stub, inline="always"))


def cache_is_damaged(error: BaseException) -> bool:
    """Whether an error came up while numba read its cache."""
    frames = traceback.extract_tb(error.__traceback__)
    return any(Path(frame.filename).name == "caching.py" and "numba" in frame.filename for frame in frames)


def forget_compiled() -> None:
    """Throw the cache folder away: the remedy for a damaged one."""
    shutil.rmtree(_FOLDER, ignore_errors=True)
    _private(_FOLDER)

"""The one jit policy, and the private on-disk cache of compiled kernels.

Contract-only fastmath keeps NaN semantics and makes results independent of chunking and threads; numba's own cache
does not notice an edited callee in another file, so the cache folder is named by a hash of every kernel's source.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import platform
import shutil
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, cast

import llvmlite.binding as llvm
import numba
from numba._dynfunc import make_function
from numba.core import types
from numba.core.caching import IndexDataCacheFile
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.errors import TypingError
from numba.core.registry import cpu_target
from numba.core.typed_passes import NativeLowering
from numba.extending import overload

#: LLVM unrolls short loops of constant length completely before its vectoriser sees them, and a loop over the lanes
#: then stays scalar; with this limit they are vectorised (twice the pace of the march).
_LLVM_OPTIONS = ("--unroll-full-max-count=8",)


def kernel_hash() -> str:
    """SHA-256 over the kernels' sources, numba's and LLVM's versions and the processor: what the bits depend on."""
    digest, folder = hashlib.sha256(), Path(__file__).parent
    for source in sorted(folder.rglob("*.py")):
        digest.update(source.relative_to(folder).as_posix().encode() + b"\0" + source.read_bytes() + b"\0")
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
#: Arrays that kernels make begin with a cache line (bytes); else half of all loads of 512 bits lie across two.
_ALIGNMENT = 64
cpu_target.target_context.get_preferred_array_alignment = lambda dtype: _ALIGNMENT

_POLICY: dict[str, Any] = {"fastmath": {"contract"}, "error_model": "numpy", "nogil": True}


class Index(IndexDataCacheFile):
    """What a kernel was compiled for, and where it lies. One process at a time adds to it: of two at once one would be
    lost, or get the code of the other."""

    def save(self, key: Any, data: Any) -> None:
        # where the disk is full, or another process has thrown the folder away, it is compiled again another time
        with suppress(OSError), open(f"{self._index_path}.lock", "ab") as lock:
            with suppress(OSError):  # a file system without locks
                fcntl.flock(lock, fcntl.LOCK_EX)
            super().save(key, data)


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function by the project's policy, cached on disk; where the cache is damaged, anew."""
    compiled = numba.njit(cache=True, **_POLICY)(function)
    if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        compiled._cache._cache_file.__class__ = Index
        compiled._cache.load_overload = _mended(compiled._cache.load_overload)
    return cast(Callable[..., Any], compiled)


def _mended(load: Callable[..., Any]) -> Callable[..., Any]:
    """Loads as ``load`` does; a cache that cannot be read is thrown away and holds nothing."""

    def load_or_forget(*prescribed: Any) -> Any:
        try:
            return load(*prescribed)
        except Exception:  # whatever garbage in its files leads to
            shutil.rmtree(_FOLDER, ignore_errors=True)
            _private(_FOLDER)
            return None

    return load_or_forget


def called(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that kernels alone call: optimised and made machine code within them, never by itself. It
    makes no arrays, and counts no references to those that it is given (half of the time of short functions)."""
    return _part_of_kernels(function)


def piece(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile such a function that stands within its callers, however long it is, as in loops over lanes."""
    return _part_of_kernels(function, forceinline=True)


def copied(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function that is copied into its callers before these are compiled: one that makes arrays. Others take
    longer to compile than with `piece`; the march is faster by a seventh where it copies what every signal takes."""
    return cast(Callable[..., Any], numba.njit(inline="always", **_POLICY)(function))


def _part_of_kernels(function: Callable[..., Any], **options: Any) -> Callable[..., Any]:
    bare: dict[str, Any] = {
        "no_cpython_wrapper": True,
        "no_cfunc_wrapper": True,
        "_nrt": False,
        "pipeline_class": _PartOfKernels,
    }
    compiled = numba.njit(**bare, **options, **_POLICY)(function)
    if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        compiled.get_call_template = _once_for_all_numbers(compiled.get_call_template)
    return cast(Callable[..., Any], compiled)


def _once_for_all_numbers(template: Callable[..., Any]) -> Callable[..., Any]:
    """Compiles as ``template`` does, for the types of arguments alone. Numba's own compiles a function anew for every
    number that a call names, which optimising it within its callers does as well."""

    def of_types(args: Any, kws: Any) -> Any:
        try:
            return template(tuple(map(types.unliteral, args)), {name: types.unliteral(kws[name]) for name in kws})
        except TypingError:  # of functions whose types depend on a number
            return template(args, kws)

    return of_types


@register_pass(mutates_CFG=True, analysis_only=False)
class _LoweringOfParts(NativeLowering):
    """Lowering to a library that callers take up as it is. Numba's own optimises every function together with all that
    it calls, and makes machine code of it, at each level anew (60 of 110 s for the moving frames)."""

    _name = "lowering_of_parts"

    def run_pass(self, state: Any) -> bool:
        """Lower the function."""
        library = state.library = state.targetctx.codegen().create_library(state.func_id.func_qualname)
        library.enable_object_caching()
        library._optimize_final_module = lambda: None
        library._finalize_final_module = partial(setattr, library, "_finalized", True)
        state.flags.no_compile = True
        super().run_pass(state)
        fndesc, env = state.cr.fndesc, state.cr.env
        # no Python calls it: it stands for what has no address
        nowhere = make_function(fndesc.lookup_module(), fndesc.qualname, "part of kernels", 0, env, (library,))
        state.targetctx.insert_user_function(nowhere, fndesc, [library])
        state["cr"] = state.cr._replace(cfunc=nowhere)
        return True


class _PartOfKernels(CompilerBase):
    """Numba's passes with the lowering above."""

    def define_pipelines(self) -> list[Any]:
        """The one pipeline."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [(_LoweringOfParts if one is NativeLowering else one, words) for one, words in passes.passes]
        passes.finalize()
        return [passes]


def chosen_for(stub: Callable[..., Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorate what picks, by the types of a call's arguments, the piece that stands for ``stub`` inside kernels."""
    return cast(Callable[[Callable[..., Any]], Callable[..., Any]], overload(stub, inline="always", strict=False))

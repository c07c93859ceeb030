"""A scheduler and its worker that speak TLS alone, set up as docs/workers.md says: certificates by openssl."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from results_schema.store.archive import open_archive
from tests.studies.every_way import assert_same_archives
from tests.studies.small import ROOT, finish, write

WHOSE = ("SCHEDULER", "WORKER", "CLIENT")


def certificate(folder: Path, name: str) -> dict[str, str]:
    """A certificate signed by itself, as dask's configuration names it in environment variables."""
    own, key = folder / f"{name}.pem", folder / f"{name}-key.pem"
    made = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", f"/CN={name}"]
    subprocess.run([*made, "-out", str(own), "-keyout", str(key)], check=True, capture_output=True)
    start = "DASK_DISTRIBUTED__COMM__"
    found = {f"{start}REQUIRE_ENCRYPTION": "true", f"{start}TLS__CA_FILE": str(own)}
    for one in WHOSE:
        found |= {f"{start}TLS__{one}__CERT": str(own), f"{start}TLS__{one}__KEY": str(key)}
    return found


@contextmanager
def running(environment: Mapping[str, str], *arguments: str) -> Iterator[None]:
    """A program of dask, while the block lasts."""
    process = subprocess.Popen(
        [sys.executable, "-m", "dask", *arguments, "--no-dashboard"],
        env=os.environ | {"PYTHONPATH": str(ROOT)} | dict(environment),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield
    finally:
        process.kill()
        process.wait()


@pytest.mark.slow
@pytest.mark.fault(40)
def test_a_scheduler_that_speaks_tls_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own, other = certificate(tmp_path, "own"), certificate(tmp_path, "other")
    write(tmp_path)
    assert finish(tmp_path, "run", "small.toml", "-o", "whole.nc").returncode == 0
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        place, port = f"127.0.0.1:{free.getsockname()[1]}", str(free.getsockname()[1])
    with ExitStack() as stack:
        stack.enter_context(running(own, "scheduler", "--host", "127.0.0.1", "--port", port))
        stack.enter_context(running(own, "worker", f"tls://{place}", "--nthreads", "1", "--no-nanny"))
        for name, address, known, code in (
            ("trusted", f"tls://{place}", own, 0),
            ("in clear", f"tcp://{place}", {}, 70),
            ("without a certificate", f"tls://{place}", {}, 2),
            ("not trusted", f"tls://{place}", other, 70),
        ):
            with monkeypatch.context() as patched:
                for key, value in known.items():
                    patched.setenv(key, value)
                done = finish(tmp_path, "run", "small.toml", "-o", f"{name}.nc", "--scheduler", address)
            assert (done.returncode, (tmp_path / f"{name}.nc").exists()) == (code, code == 0), (name, done.stderr)
    assert_same_archives(open_archive(tmp_path / "trusted.nc"), open_archive(tmp_path / "whole.nc"))

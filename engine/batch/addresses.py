"""Addresses of schedulers: what is met on this machine alone, and what is told apart from it by TLS."""

from __future__ import annotations

import ipaddress
import os
import socket
from urllib.parse import urlsplit

from results_schema.errors import BadInput

EXPECTED = "tcp://127.0.0.1:PORT on this machine, tls://HOST:PORT on others"
TLS_FILES = ("ca-file", "client.cert", "client.key")  # below distributed.comm.tls in dask's configuration


def check_address(address: str) -> None:
    """Refuse what is no address, another host without TLS, and TLS without certificates. Raises BadInput."""
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not host or not port or parts.scheme not in ("tcp", "tls"):
        raise BadInput("not the address of a scheduler", where="scheduler", expected=EXPECTED, received=address)
    if parts.scheme == "tcp" and not is_here(host):
        what = "a scheduler on another host is met by TLS alone: whoever reads along or answers could run programs here"
        raise BadInput(what, where="scheduler", expected=EXPECTED, received=address)
    if parts.scheme == "tls":
        _check_certificates()


def is_here(host: str) -> bool:
    """Whether a host is reached without leaving this machine."""
    try:
        found = {info[4][0] for info in socket.getaddrinfo(host, None)}
    except OSError:
        return False
    return bool(found) and all(ipaddress.ip_address(str(one).partition("%")[0]).is_loopback for one in found)


def _check_certificates() -> None:
    import dask.config
    import distributed.config  # noqa: F401 (its defaults)

    for name in TLS_FILES:
        key = f"distributed.comm.tls.{name}"
        file = dask.config.get(key, None)
        if not file or not os.path.isfile(file):
            variable = "DASK_" + key.upper().replace(".", "__").replace("-", "_")
            remedy = f"set {variable}, or {key} in dask's configuration"
            what = "TLS needs the certificate of who signs, one's own, and its key"
            raise BadInput(what, where="scheduler", expected=f"a file {key}", received=str(file), remedy=remedy)

"""Real servers for tests: the questionnaire in a process of its own, and PostgreSQL, both on the loopback alone."""

from __future__ import annotations

import contextlib
import glob
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextlib.contextmanager
def served(folder: Path, *more: str) -> Iterator[tuple[str, subprocess.Popen]]:
    """`signface study serve FOLDER`; its address and its process."""
    port = free_port()
    command = [sys.executable, "-m", "signface.cli.main", "study", "serve", str(folder), "--port", str(port), *more]
    with open(folder / "serve.log", "w") as log:
        process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)
    address = f"http://127.0.0.1:{port}"
    try:
        for _ in range(400):
            with contextlib.suppress(httpx.TransportError):
                httpx.get(address, timeout=5)
                break
            assert process.poll() is None, (folder / "serve.log").read_text()
            time.sleep(0.1)
        else:
            raise AssertionError("the server did not begin")
        yield address, process
    finally:
        process.kill()
        process.wait()


@contextlib.contextmanager
def postgresql() -> Iterator[str]:
    """A new PostgreSQL server and the URL of an empty database; skipped where it is not installed."""
    places = [*sorted(glob.glob("/usr/lib/postgresql/*/bin"), reverse=True), *filter(None, [shutil.which("initdb")])]
    folder = next((Path(place) if Path(place).is_dir() else Path(place).resolve().parent for place in places), None)
    if folder is None:
        pytest.skip("PostgreSQL is not installed (Debian's package postgresql)")
    # PostgreSQL refuses to run as root: it then runs as the user that its package made, or as nobody.
    as_user: list[str] = []
    owner = None
    if os.geteuid() == 0:
        owner = "postgres" if Path("/etc/passwd").read_text().find("\npostgres:") >= 0 else "nobody"
        as_user = ["setpriv", f"--reuid={owner}", "--clear-groups"]
    with tempfile.TemporaryDirectory(prefix="signface-pg-") as name:
        data = Path(name) / "data"
        if owner:
            shutil.chown(name, owner)
            os.chmod(name, 0o700)
        run = {"check": True, "stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "cwd": name}
        initialise = [*as_user, str(folder / "initdb"), "-D", str(data), "-A", "trust", "-U", "signface", "-E", "UTF8"]
        subprocess.run([*initialise, "--locale=C", "-N"], **run)
        port = free_port()
        command = [*as_user, str(folder / "postgres"), "-D", str(data), "-p", str(port), "-k", name]
        process = subprocess.Popen(
            [*command, "-c", "listen_addresses=127.0.0.1"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=name,
        )
        url = f"postgresql://signface@127.0.0.1:{port}/postgres"
        try:
            import psycopg

            for _ in range(300):
                with contextlib.suppress(psycopg.OperationalError):
                    psycopg.connect(url, connect_timeout=2).close()
                    break
                assert process.poll() is None, "PostgreSQL ended"
                time.sleep(0.1)
            yield url
        finally:
            process.send_signal(2)  # a fast shutdown
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

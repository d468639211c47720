"""A room like a fresh container: the distribution's own programs, an empty home, a clone of this repository.

Nothing need be installed for it: ``unshare`` gives a mount namespace, in which /usr, /etc and the like are those of the
machine and all else is empty; /usr/local, where people put things of their own, is empty too. Where namespaces are
refused only the environment is clean: PATH is that of the system, HOME is new, no other variable is passed on.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

_OF_SYSTEM = ("usr", "etc", "dev")
_LINKED = ("bin", "sbin", "lib", "lib32", "lib64", "libx32")
# Where packages come from and how that is trusted belongs to the network, not to the user.
_PASSED_ON = ("PIP_", "SSL_CERT_", "REQUESTS_CA_BUNDLE", "CURL_CA_BUNDLE", "http_proxy", "https_proxy", "no_proxy")
_PATH = "/usr/bin:/bin"
_NAMESPACE = ("unshare", "--mount", "--map-root-user", "--pid", "--fork")
HOME = "/root"
REPOSITORY = f"{HOME}/repository"


@dataclass(frozen=True)
class Done:
    """How a command ended.

    Attributes:
        status: exit status.
        output: standard output and error, as they came.
    """

    status: int
    output: str


class CleanRoom:
    """A room to run commands in.

    Args:
        folder: empty, for its files.
        repository: is cloned into it, what is committed only.
        shared: further folders that are to be seen within, such as one that pip takes packages from; read-only.
    """

    def __init__(self, folder: Path, repository: Path, shared: tuple[Path, ...] = ()) -> None:
        self._folder = folder.resolve()
        self._shared = tuple(path.resolve() for path in shared)
        self.is_closed = self._can_close()
        self._home = self._folder / HOME.lstrip("/")
        for name in ("proc", "tmp", "run", "var/tmp", *_OF_SYSTEM, HOME.lstrip("/")):
            (self._folder / name).mkdir(parents=True, exist_ok=True)
        for name in _LINKED:
            if os.path.islink(f"/{name}"):
                (self._folder / name).symlink_to(os.readlink(f"/{name}"))
            elif os.path.isdir(f"/{name}"):
                (self._folder / name).mkdir()
        for path in self._shared:
            self._within(path).mkdir(parents=True, exist_ok=True)
        clone = ["git", "clone", "--quiet", "--no-hardlinks", str(repository), str(self.path(REPOSITORY))]
        subprocess.run(clone, check=True)

    def path(self, within: str) -> Path:
        """Return where a path of the room is outside."""
        return self._folder / within.lstrip("/")

    def run(self, command: str, *, cwd: str = REPOSITORY, first_on_path: str = "", timeout_s: float = 3600.0) -> Done:
        """Run a line of shell.

        Args:
            command: the line.
            cwd: where, in the room.
            first_on_path: folder of programs that were installed in the room.
            timeout_s: after which it counts as hanging [s].
        """
        programs = f"{first_on_path}:{_PATH}" if first_on_path else _PATH
        if self.is_closed:
            script = f'{self._mounts()}\nexec chroot {shlex.quote(str(self._folder))} env -i "$@"'
            inner = f"cd {shlex.quote(cwd)} && {command}"
            start = [
                "unshare",
                "--mount",
                "--map-root-user",
                "--pid",
                "--fork",
                "--kill-child",
                "bash",
                "-ec",
                script,
                "-",
            ]
            home = HOME
        else:
            inner, home = f"cd {shlex.quote(str(self.path(cwd)))} && {command}", str(self._home)
            programs = programs.replace(HOME, home)
            start = ["env", "-i"]
        variables = {"HOME": home, "PATH": programs, "LANG": "C.UTF-8", **_passed_on()}
        full = [*start, *(f"{name}={value}" for name, value in variables.items()), "bash", "-c", inner]
        try:
            done = subprocess.run(
                full,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                timeout=timeout_s,
                check=False,
            )
        except subprocess.TimeoutExpired as hanging:
            return Done(124, (hanging.output or b"").decode(errors="replace"))
        return Done(done.returncode, done.stdout.decode(errors="replace"))

    def close(self) -> None:
        """Remove the room."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def _within(self, path: Path) -> Path:
        return self._folder / str(path).lstrip("/")

    def _mounts(self) -> str:
        root = shlex.quote(str(self._folder))
        lines = ["mount --make-rprivate /"]
        lines += [f"mount --rbind /{name} {root}/{name}" for name in _OF_SYSTEM]
        lines += [
            f"mount --rbind /{name} {root}/{name}"
            for name in _LINKED
            if not (self._folder / name).is_symlink() and (self._folder / name).is_dir()
        ]
        lines += [f"mount -t proc proc {root}/proc", f"mount -t tmpfs tmpfs {root}/usr/local"]
        for path in self._shared:
            lines.append(f"mount --rbind {shlex.quote(str(path))} {shlex.quote(str(self._within(path)))}")
        return "\n".join(lines)

    @staticmethod
    def _can_close() -> bool:
        tried = [*_NAMESPACE, "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
        try:
            return subprocess.run(tried, capture_output=True, check=False, timeout=30).returncode == 0
        except (OSError, subprocess.TimeoutExpired):
            return False


def _passed_on() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name.startswith(_PASSED_ON)}

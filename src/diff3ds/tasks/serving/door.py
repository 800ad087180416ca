"""Who may ask a server on this machine: its own browser, by the secret in the address and a name of this machine."""

import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field
from urllib.parse import unquote

# The address it listens on, unless another is asked for; how browsers call this machine; all addresses of a machine.
HOST = "127.0.0.1"
NAMES = (HOST, "localhost", "[::1]")
EVERYWHERE = ("0.0.0.0", "::")
# What a request calls a server: a name or address, and a port; what users call one.
_AUTHORITY = re.compile(r"(\[[0-9a-f:.]+\]|[^\[\]:/@\s]+)(?::[0-9]{1,5})?")
_NAME = re.compile(r"[\w.-]+")


@dataclass(frozen=True)
class Door:
    """Lets in what asks for this machine by name, through whatever port a tunnel has, and knows the secret.

    Not other sites' scripts, and no name that another site has pointed here.

    Attributes:
        command: of diff3ds that serves, for sentences.
        port: that it listens on.
        called: how its address names the machine.
        allowed: other names by which browsers reach this machine, such as that of a hub that passes requests on.
        secret: in the address.
    """

    command: str
    port: int
    called: str
    allowed: frozenset[str]
    secret: str = field(default_factory=lambda: secrets.token_urlsafe(16))

    @classmethod
    def at(cls, command: str, host: str, port: int, allowed: Sequence[str] = ()) -> "Door":
        """The door of what listens on this address and port."""
        called = HOST if host in EVERYWHERE else f"[{host}]" if ":" in host else host
        return cls(command, port, called, frozenset(name.lower() for name in allowed))

    @property
    def address(self) -> str:
        """To open, with its secret."""
        return f"http://{self.called}:{self.port}/{self.secret}/"

    @property
    def names(self) -> set[str]:
        """Of this machine."""
        return {*NAMES, self.called.lower()}

    def refusal(self, host: str, origin: str | None, must_say: bool) -> str | None:
        """Why somebody else who asks is refused; None for this machine's browser.

        Args:
            host: what the request calls the server.
            origin: the page that asks; None where that is not said.
            must_say: whether it has to be said: browsers say who writes.
        """
        foreign = must_say if origin is None else not self._is_own_page(origin)
        if self._is_named(host) and not foreign:
            return None
        told = self.address.replace(self.secret, "...")
        return (
            f"this page is for the browser of its own machine: open it as {told}, or by localhost with the port of a "
            f"tunnel (ssh -L {self.port}:{HOST}:{self.port} MACHINE). To reach it by another name, as through a hub "
            f"or a container, start diff3ds {self.command} with --allow-host NAME"
        )

    def asked(self, path: bytes) -> str | None:
        """What stands behind the secret in an address as it came, without its question; None without the secret."""
        secret, slash, name = path.removeprefix(b"/").partition(b"/")
        known = secrets.compare_digest(secret, self.secret.encode())
        return unquote(name.decode("latin-1")) if known and slash else None

    def _is_named(self, authority: str) -> bool:
        name = _name_in(authority)
        return name in self.names or name in self.allowed

    def _is_own_page(self, origin: str) -> bool:
        """Names that are allowed may be those of a hub that speaks https."""
        scheme, _, authority = origin.partition("://")
        name = _name_in(authority)
        return (scheme == "http" and name in self.names) or (scheme in ("http", "https") and name in self.allowed)


def check_names(allowed: Sequence[str]) -> None:
    """Sees that these are names of machines.

    Raises:
        ValueError: one is none.
    """
    for name in allowed:
        if not _NAME.fullmatch(name):
            raise ValueError(f"allow_host must be a name alone, such as hub.example.org, got {name!r}")


def _name_in(authority: str) -> str | None:
    """The name or address, without the port, in lower case; None of what is neither."""
    found = _AUTHORITY.fullmatch(authority.lower())
    return found[1] if found else None

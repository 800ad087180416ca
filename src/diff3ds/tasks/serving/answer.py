"""What is asked of a page's server and what it answers, whatever it listens by."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from http import HTTPStatus
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Asked:
    """A request that was let in.

    Attributes:
        method: GET, PUT, POST or DELETE.
        name: what stands behind the secret in the address.
        question: what stands behind the question mark, by name.
        held: the file's state that the page says it has, of `If-Match`.
        body: what came with it; of a file that came, nothing.
        file: where the content of a file that came lies until the answer is there.
    """

    method: str
    name: str
    question: dict[str, str] = field(default_factory=dict)
    held: str = ""
    body: bytes = b""
    file: Path | None = None

    @property
    def text(self) -> str:
        """What came with it.

        Raises:
            ValueError: it is no UTF-8.
        """
        try:
            return self.body.decode()
        except UnicodeDecodeError as error:
            raise ValueError(f"the text did not come whole, as UTF-8: {error}") from error

    def within(self, name: str) -> "Asked":
        """The same, of a part that has a page of its own."""
        return Asked(self.method, name, self.question, self.held, self.body, self.file)


@dataclass(frozen=True)
class Answer:
    """What is answered; `saved_as` is the name of a file to save."""

    status: HTTPStatus
    kind: str = "text/plain"
    body: str | bytes = ""
    saved_as: str = ""


Answers = Callable[[Asked], Answer | None]


def as_json(value: Any) -> Answer:
    """An answer that is JSON."""
    return Answer(HTTPStatus.OK, "application/json", json.dumps(value))


def refused(error: Exception) -> Answer:
    """The answer to what cannot be done: what is wrong, in a sentence."""
    status = HTTPStatus.BAD_REQUEST if isinstance(error, ValueError) else HTTPStatus.INSUFFICIENT_STORAGE
    return Answer(status, body=str(error))

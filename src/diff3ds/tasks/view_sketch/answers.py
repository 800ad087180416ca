"""What the page of a sketch or a run asks for, saves and keeps: the answers, whoever serves them."""

import json
from http import HTTPStatus

from diff3ds.tasks.serving.answer import Answer, Asked, refused
from diff3ds.tasks.view_sketch import saving
from diff3ds.tasks.view_sketch.run_folder import picture_in
from diff3ds.tasks.view_sketch.shown_page import ShownPage

# Before the names of a run's pictures, and of pages that keep edits.
PICTURE, KEPT = "picture/", "autosave/"


def answer_of(page: ShownPage, asked: Asked) -> Answer | None:
    """What this page answers; None where there is nothing of that name."""
    kept = kept_name(asked.name)
    if asked.method == "GET":
        try:
            return _found(page, asked.name, kept)
        except (ValueError, OSError) as error:
            # Such as kept edits that something has damaged: the page says so.
            return Answer(HTTPStatus.INTERNAL_SERVER_ERROR, body=str(error))
    if asked.method == "DELETE" and kept is not None:
        saving.forget(page.shown, kept)
        return Answer(HTTPStatus.NO_CONTENT)
    if asked.method == "PUT" and (kept is not None or asked.name in ("sketch", "copy")):
        try:
            return Answer(HTTPStatus.OK, "application/json", _saved(page, asked, kept))
        except saving.ChangedError as error:
            return Answer(HTTPStatus.PRECONDITION_FAILED, body=str(error))
        except (ValueError, OSError) as error:
            return refused(error)
    return None


def kept_name(name: str) -> str | None:
    """The page whose kept edits an address is that of; None of others."""
    page = name.removeprefix(KEPT) if name.startswith(KEPT) else ""
    return page if saving.PAGE_NAME.fullmatch(page) else None


def _saved(shown: ShownPage, asked: Asked, kept: str | None) -> str:
    if kept is not None:
        saving.keep(shown.shown, kept, asked.text)
        return "{}"
    if asked.name == "copy":
        with shown.lock:
            target = saving.save_copy(shown.shown, asked.text)
        shown.say(f"saved {target}")
        return json.dumps({"name": target.name})
    return shown.save(asked.text, asked.held)


def _found(page: ShownPage, name: str, kept: str | None) -> Answer | None:
    texts = {
        "": ("text/html", page.text),
        "version": ("text/plain", page.version),
        "sketch": ("application/json", page.sketch),
        "run": ("application/json", page.run),
        "autosaves": ("application/json", lambda: saving.kept_by_pages(page.shown)),
    }
    content: str | bytes | None
    if name in texts:
        kind, made = texts[name]
        content = made()
    elif kept is not None:
        kind, content = "application/json", saving.kept_of(page.shown, kept)
    elif page.is_run and name.startswith(PICTURE):
        kind, content = "image/png", picture_in(page.source, name.removeprefix(PICTURE))
    else:
        return None
    return None if content is None else Answer(HTTPStatus.OK, kind, content)

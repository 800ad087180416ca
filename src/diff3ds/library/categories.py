"""All categories: one to each file of `library/kinds`, found there, so that a new one is one file."""

from importlib import import_module
from pkgutil import iter_modules

from diff3ds.library import kinds
from diff3ds.library.category import Category

CATEGORIES: dict[str, Category] = {
    category.name: category
    for found in iter_modules(kinds.__path__, f"{kinds.__name__}.")
    for category in (import_module(found.name).CATEGORY,)
}

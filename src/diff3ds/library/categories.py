"""The list of all categories: a new one is one file and one line here."""

from diff3ds.library import bottle, car, chair, house, lamp, mug, rocket, table
from diff3ds.library.category import Category

CATEGORIES: dict[str, Category] = {
    module.CATEGORY.name: module.CATEGORY for module in (bottle, car, chair, house, lamp, mug, rocket, table)
}

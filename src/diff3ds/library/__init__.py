"""Procedural 3D sketches: scenes with known answers, and members of nearly eighty kinds of things, with captions."""

from diff3ds.library.categories import CATEGORIES
from diff3ds.library.category import Attribute, Category
from diff3ds.library.demo import demo_cameras, demo_sketch
from diff3ds.library.members import Member, member

__all__ = ["CATEGORIES", "Attribute", "Category", "Member", "demo_cameras", "demo_sketch", "member"]

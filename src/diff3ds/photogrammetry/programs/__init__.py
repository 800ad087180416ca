"""Readers of the files with cameras of other programs and data sets, one file a program."""

"""Curves that the views show and the first ones lack: whole circles, missing lines, corners, pockets."""

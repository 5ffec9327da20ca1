"""The `turnmill` command."""

from turnmill_ros.cli.app import app, main

__all__ = ["app", "main"]

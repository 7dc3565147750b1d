"""What comes out of a diagnosis for people: figures and one page."""

from .page import write_report

__all__ = ["write_report"]

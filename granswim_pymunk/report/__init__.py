"""What comes out of a diagnosis for people: figures and one page."""

from .page import pictures, write_diagnosis, write_report

__all__ = ["pictures", "write_diagnosis", "write_report"]

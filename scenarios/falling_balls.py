"""The falling balls with both weights that the list gives for the bowling ball, diagnosed one after the other.

The shipped recording takes 208 oz (a density of 1086 kg/m^3); 81 oz would be 452 kg/m^3. What is claimed
about the drag of the bowling ball should not hang on that.
"""

import sys
from pathlib import Path

from granswim_pymunk.inference import diagnose
from granswim_pymunk.recording import shipped
from granswim_pymunk.recording.importers import import_recording


def main(out: str = "out/falling_balls") -> None:
    for ounces in (81, 208):
        recordings = import_recording(shipped("falling_balls") / "source", "falling_balls", bowling_ball=ounces)
        verdict = diagnose(recordings, Path(out) / f"bowling_ball_{ounces}_oz").verdict
        named = ", ".join(body for entry in verdict["mechanisms"] for body in entry["bodies"])
        print(f"{ounces} oz: {verdict['verdict']}, {verdict['mechanisms'][0]['name']} on {named}")
        for note in verdict["notes"]:
            print(f"  {note}")


if __name__ == "__main__":
    main(*sys.argv[1:])

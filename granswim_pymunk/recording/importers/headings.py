"""What a column of a table is by its heading, in the languages and habits of those who write tables.

Compared are words in small letters, without accents, units, counting words (``track n°`` is ``track``) and without
what programs of school laboratories put around them (``Latest: X (m)``, ``Time (s) Run #1``).
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence

from ...errors import InputError
from .units import ANGLES, LENGTHS, PIXELS, SENSOR, TIMES, is_unit, split_unit

NAMES: dict[str, tuple[str, ...]] = {
    "t": ("t", "time", "times", "trial time", "timestamp", "time stamp", "elapsed time", "seconds", "zeit", "uhrzeit",
          "zeitpunkt", "temps", "tiempo", "tempo", "datetime", "tijd", "aika", "czas"),
    "frame": ("frame", "frames", "frameindex", "framenumber", "image", "slice", "bild", "einzelbild", "bildnummer",
              "trame", "quadro", "cuadro", "fotograma", "fotogramma", "imagem", "imagen", "bilde",
              "billede", "bildruta"),
    "body": ("body", "particle", "track", "trackid", "trajectory", "tid", "id", "object", "individual", "marker",
             "disk", "disc", "grain", "ball", "puck", "name", "label",
             "korper", "koerper", "teilchen", "partikel", "kugel", "scheibe", "objekt", "spur", "punkt",
             "objet", "corps", "particule", "bille", "palet",
             "corpo", "particula", "objeto", "bola", "disco", "cuerpo", "particella", "oggetto",
             "partikkel", "kule", "kugle", "kula"),
    "x": ("x", "posx", "xpos", "cx", "abscisse", "abscissa", "abszisse"),
    "y": ("y", "posy", "ypos", "cy", "ordonnee", "ordinate", "ordenada", "ordinata"),
    "angle": ("angle", "theta", "phi", "θ", "φ", "orientation", "winkel", "drehwinkel", "auslenkwinkel", "angulo",
              "angolo", "angular position", "angular displacement", "ang", "vinkel", "hoek"),
}  # fmt: skip
# times from row to row, where no column is a clock
STEPS = ("dt", "delta t", "δt", "deltat", "time step", "timestep", "zeitschritt")
# beside x or y they leave it what it is: "Ort x", "posição x", "Centroid.X", "center_y"
BESIDE = {
    "position", "pos", "coordinate", "coord", "center", "centre", "centroid", "wcentroid", "mean", "com",
    "ort", "lage", "koordinate", "mittelpunkt", "schwerpunkt", "coordonnee", "posicao", "coordenada", "centro", "meio",
    "posicion", "posizione", "coordinata", "baricentro", "posisjon", "positie",
}  # fmt: skip
# a single coordinate, where there is no x or y
ALONE = ("position", "pos", "ort", "lage", "weg", "strecke", "distance", "displacement", "posicao", "posicion",
         "posizione", "distancia", "deslocamento", "posisjon", "avstand", "strekning", "stracka", "afstand",
         "positie")  # fmt: skip
# the letter of a way along a line, as motion sensors write it beside v and a; alone it may be anything
WAY, RATES_OF_WAY = "s", (["v"], ["a"])
HEIGHT = "h"  # as the letter of a height, beside its error
SPEEDS = {"v", "vx", "vy", "vz"}  # letters of velocities
# the same, of which the axis is clear; not where it is the size of a box, beside its width
UPRIGHT = ("height", "altitude", "hohe", "hoehe", "hauteur", "altura", "altezza", "elevation",
           "høyde", "højde", "hojd", "hoogte")  # fmt: skip
WIDTHS = {"width", "breite", "largeur", "largura", "ancho", "larghezza", "w"}
# a deflection: an angle where its unit is one
DEFLECTION = ("auslenkung", "deflection", "elongation", "rotation", "drehung")
COUNTING = {"n°", "n", "no", "nr", "num", "number", "nummer", "numero", "id", "idx", "index"}
# what has coordinates and is no place
RATES = {
    "velocity", "velocities", "vel", "speed", "acceleration", "accel", "acc", "force", "momentum", "gyroscope", "gyro",
    "field", "accelerometer", "geschwindigkeit", "beschleunigung", "kraft", "vitesse", "velocidade", "velocidad",
    "velocita", "aceleracao", "aceleracion", "accelerazione", "forca", "fuerza", "forza", "fart", "hastighet",
    "hastighed", "akselerasjon", "snelheid", "versnelling", "kracht",
}  # fmt: skip
# beside a coordinate they are no bodies: rates and errors
NO_BODY = re.compile(
    r"d?dots?\d*|mom|freq|frequency|rate|err(?:or)?s?|std|sigma|sem|noise|uncertainty|fehler", re.IGNORECASE
)
_RATE_UNIT = re.compile(r".*[/^²³·].*|N|V|T|[mµμu]T|Hz|kHz|W|J|Pa|k?g")
# of a column that a user calls a place: a sensor may tell one in volts, and never in anything by time
_BY_TIME = re.compile(r".*/\s*(?:s|sec|min|h)\b.*|.*\bs\s*(?:\^\s*)?[-−⁻].*")


def folded(text: str) -> str:
    """A text in small letters without accents."""
    letters = unicodedata.normalize("NFKD", text.lower())
    return "".join(letter for letter in letters if not unicodedata.combining(letter))


def words(column: str) -> list[str]:
    """A heading's words as they are compared."""
    found = re.findall(r"[^\s_.,:;{}#]+", folded(split_unit(column)[0]))
    return [word for word in found if word not in COUNTING] or found


def is_rate(column: str) -> bool:
    """Whether a column has a velocity, an acceleration, a force ...: by a word, or by its unit."""
    unit = split_unit(column)[1]
    rate = unit is not None and not is_unit(unit) and unit.lower() not in PIXELS and _RATE_UNIT.fullmatch(unit)
    return bool(rate or RATES.intersection(words(column)))


def is_lone(column: str) -> bool:
    """Whether a column is a coordinate of which its heading does not say the axis."""
    return " ".join(words(column)) in ALONE


def is_way(column: str, header: Sequence[str]) -> bool:
    """Whether a column is the place along a line as the letter s: beside v or a, or in a unit of lengths."""
    if words(column) != [WAY]:
        return False
    return split_unit(column)[1] in LENGTHS or any(words(name) in RATES_OF_WAY for name in header)


def is_height(column: str, header: Sequence[str]) -> bool:
    """Whether a column is a height as the letter h: in a unit of lengths, or beside its error (h_err)."""
    beside = (words(name) for name in header if name != column)
    return words(column) == [HEIGHT] and (
        split_unit(column)[1] in LENGTHS or any(said[0] == HEIGHT and NO_BODY.fullmatch(said[-1]) for said in beside)
    )


def called_a_place(column: str) -> str:
    """What is said of a column that a user calls a place, where its heading is that of a rate; empty for others."""
    if not (RATES | SPEEDS).intersection(words(column)):
        return ""
    return f"{column} is taken for a place, as you say, though by its heading it is a rate"


def is_third(column: str) -> bool:
    """Whether a column is the third coordinate of a place."""
    said = words(column)
    return "z" in said and BESIDE.union("z").issuperset(said) and not is_rate(column)


# Norwegian, Swedish and Danish for time; also what MTrackJ calls the number of a track, which has no unit
NORDIC = "tid"


def is_clock(column: str) -> str | None:
    """ "t" or "frame", where a column is a clock by its heading."""
    name = " ".join(words(column))
    if name == NORDIC:
        return "t" if split_unit(column)[1] in TIMES else None
    return next((key for key in ("t", "frame") if name in NAMES[key]), None)


def is_from_top(header: Sequence[str]) -> bool:
    """Whether a table is one of ImageJ (Results, Manual Tracking, MTrackJ), which counts y from the top of a picture.

    Its word for a frame is Slice, that of MTrackJ for a track TID, beside a clock; Results have a nameless column and
    perhaps a Label.
    """
    said = {word for column in header for word in words(column)}
    tracks = NORDIC in said and any(is_clock(name) and words(name) != [NORDIC] for name in header)
    return "slice" in said or tracks or (list(header[:1]) == ["index"] and "Label" in header)


def _matches(key: str, header: Sequence[str]) -> list[str]:
    """Columns that are a key, best first; those of one rank are of several runs."""
    if key == "body":
        header = [name for name in header if is_clock(name) != "t"]
    for wanted in NAMES[key]:
        found = [name for name in header if " ".join(words(name)) == wanted]
        if found:
            return sorted(found, key=lambda name: name.lower() != wanted)
    if key == "t":
        return [name for name in header if is_clock(name) == key]
    if key in ("x", "y"):
        return [name for name in header if key in (said := words(name)) and BESIDE.union(key).issuperset(said)]
    return []


def find_columns(header: Sequence[str], given: Mapping[str, str]) -> dict[str, str]:
    """Which column is what: those given, then exact names, then names in other words, with a unit or in a language.

    A table without a clock may have a column "step", of times from row to row.

    Raises InputError where a table has several runs, or several sensors, side by side, and where a column that is
    given as a place is in something by time.
    """
    found = dict(given)
    for key in ("x", "y", "angle"):
        unit = split_unit(given.get(key, ""))[1] or ""
        if _BY_TIME.fullmatch(unit):
            raise InputError(
                f"{key}: the column {given[key]!r} is in {unit}, a rate and no place: sum it up over time first, or "
                "say another column",
                where="columns",
            )
    open_to = [name for name in header if name not in given.values() and not is_rate(name)]

    def take(key: str, names: Sequence[str]) -> None:
        if names:
            first = words(names[0])
            beside = [name for name in names if words(name) == first and _source(name) != _source(names[0])]
            if key == "angle" and ((beside and {"x", "y"} & given.keys()) or first in map(words, given.values())):
                return  # a place, or another run, was said: no angle is asked for
            if beside:
                what = "runs" if _source(names[0])[0] != _source(beside[0])[0] else "sensors"
                column = f'"{names[0]}"' if "," in names[0] else names[0]
                upright = f"y={column} where it is the vertical one, " if is_lone(names[0]) else ""
                raise InputError(
                    f"has several {what}, {names[0]!r} and {beside[0]!r}: say which columns, as --columns "
                    f"'{key}={column}' ({upright}BODY.{key}={column} where there are several bodies)",
                    where="table",
                )
            found[key] = names[0]
            open_to.remove(names[0])

    for key in NAMES:
        if key not in found and not (key == "frame" and "t" in given):
            take(key, _matches(key, open_to))
    if not {"t", "frame"} & found.keys() and "body" not in given and words(found.get("body", "")) == [NORDIC]:
        found["t"] = found.pop("body")  # a table of tracks would have a clock beside it
    if not {"t", "frame", "body"} & found.keys():
        take("step", [name for name in open_to if " ".join(words(name)) in STEPS])
    if not {"x", "y"} & found.keys() and not any(WIDTHS.intersection(words(name)) for name in header):
        take("y", [n for n in open_to if " ".join(words(n)) in UPRIGHT] or [n for n in open_to if is_height(n, header)])
    if not {"x", "y"} & found.keys():
        take("x", sorted(filter(is_lone, open_to), key=lambda name: ALONE.index(" ".join(words(name)))))
    if not {"x", "y"} & found.keys():
        take("x", [name for name in open_to if is_way(name, header)])
    if "angle" not in found:
        take("angle", [name for name in open_to if " ".join(words(name)) in DEFLECTION and _is_angle(name)])
    return found


def _is_angle(column: str) -> bool:
    return split_unit(column)[1] in ANGLES


def _source(column: str) -> tuple[str, str]:
    """The number of the run and the name of the sensor that a heading says, empty where it says none."""
    run = re.search(r"(?:^run\s*#?\s*(\d+)|run\s*#?\s*(\d+)\s*(?:\(|$))", column.strip().lower())
    sensor = SENSOR.search(column)
    return (run[1] or run[2]) if run else "", sensor[1].lower() if sensor else ""

"""Words that may stand behind options, where nothing has to be imported for them."""

MODES = ("verlet", "chipmunk", "python", "batch")  # how forces enter
COLORS = ("speed", "force")  # what colours the grains of a picture
VIDEOS = ("gif", "mp4", "none")

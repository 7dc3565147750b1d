"""Steps of a diagnosis that are the same for every kind of recording: criteria, noise, what explains, the verdict."""

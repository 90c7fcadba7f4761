"""What a run leaves: measures, frames, pictures, files that are complete or absent."""

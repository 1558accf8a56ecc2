"""Force plates and base force sensors over serial lines."""

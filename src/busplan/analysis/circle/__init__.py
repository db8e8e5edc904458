"""Is the circle still round?"""

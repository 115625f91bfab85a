"""History along the motion of shadows, of mirror images, and of what uncovers a surface."""

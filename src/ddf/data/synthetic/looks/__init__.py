"""How shapes look: textures of their paints, the lights that fall on them, and what each category wears.

Looks have random streams of their own: meshes and cameras are the same whatever a shape wears.
"""

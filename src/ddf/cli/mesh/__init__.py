"""Commands about meshes and clouds: no field takes part."""

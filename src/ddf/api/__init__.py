"""The Python interface: `import ddf` gives all of it (src/ddf/__init__.py), each part imported when it is used."""

"""Split your own ShapeNet into train and test views, as `ddf split` does.

The root holds ShapeNetRendering/<class>/<shape>/; docs/shapenet.md says more.

python examples/own_shapenet.py /path/to/shapenet lists
"""

import argparse
from pathlib import Path

from ddf.data import shapenet, splits

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("root", type=Path)
    parser.add_argument("out", type=Path, help="folder that gets train_list.txt and test_list.txt")
    args = parser.parse_args()

    try:
        listing = {synset: shapenet.list_shapes(args.root, synset) for synset in shapenet.list_classes(args.root)}
        classes = splits.split(listing)
        args.out.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    for part in ("train", "test"):
        text = splits.list_text(classes, part)
        (args.out / f"{part}_list.txt").write_text(text)
        print(f"{part}: {text.count(chr(10))} views of {len(classes)} classes")

"""The laboratory: the experiments of the paper, in a checkout of the repository. Imports `ddf`, never the other way."""

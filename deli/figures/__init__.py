"""The paper's figures, remade from configs: runs, datasets and pictures."""

from deli.figures.drawing import draw
from deli.figures.making import Maker
from deli.figures.model import CONFIGS, FigureConfig, load, load_folder

__all__ = ["CONFIGS", "FigureConfig", "Maker", "draw", "load", "load_folder"]

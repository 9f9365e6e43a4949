"""Draws way_of_a_block.png, the figure of docs/architecture.md.

python docs/pictures/way_of_a_block.py
"""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

STAGES = [
    ("traversal", "packet of rays", "leaves, nearest first"),
    ("coverage", "edge functions, depth", "regions"),
    ("surface", "plane equations", "samples"),
    ("shadows", "shafts, occluders", "shadow masks"),
    ("shading", "Blinn-Phong, GGX", "colours"),
    ("output", "encode, add up", "frames, sensor planes"),
]


def main() -> None:
    figure, axes = plt.subplots(figsize=(11, 3))
    for k, (name, inside, out) in enumerate(STAGES):
        x = 1.8 * k
        axes.add_patch(plt.Rectangle((x, 0), 1.25, 1, facecolor="#e8eef7", edgecolor="#345"))
        axes.text(x + 0.625, 0.66, f"{name}/", ha="center", weight="bold", fontsize=11)
        axes.text(x + 0.625, 0.3, inside.replace(", ", ",\n"), ha="center", va="center", fontsize=8)
        axes.annotate("", (x + 1.8, 0.5), (x + 1.25, 0.5), arrowprops={"arrowstyle": "->"})
        axes.text(x + 1.52, -0.32, out.replace(", ", ",\n"), ha="center", fontsize=9, color="#a40")
        axes.plot([x + 1.52, x + 1.52], [-0.12, 0.46], color="#a40", linewidth=0.8, linestyle=":")
    axes.text(3.05, 1.25, "a block is known by its regions alone from here on", fontsize=9)
    axes.plot([3.32, 3.32], [0.55, 1.2], color="#a40", linewidth=0.8)
    axes.set_xlim(-0.1, 11.4)
    axes.set_ylim(-0.55, 1.5)
    axes.axis("off")
    figure.tight_layout()
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=110)


if __name__ == "__main__":
    main()

"""A small network that finds depth in focal stacks (torch)."""

from collections.abc import Iterator

import numpy as np
import torch
from torch import nn
from torch.nn import functional

WIDTHS = (16, 32, 64)
"""The channels at a half, a quarter and an eighth of the picture's size."""
CONTRAST = 0.002
"""The contrast that is added to the stack's, so that flat parts have no sharpness."""
LEAST = 0.02
"""The least dioptres of an answer."""
OFFSET = 0.1
"""The dioptres that are added in the loss's logarithm, so that what is far counts finitely."""


class Block(nn.Module):
    """Two convolutions; each pixel gets the greatest value over the stack beside its own.

    Source of the second: Maximov et al., "Focus on defocus", CVPR 2020.
    """

    def __init__(self, inputs: int, outputs: int):
        super().__init__()
        self.first = nn.Conv2d(inputs, outputs, 3, padding=1)
        self.second = nn.Conv2d(2 * outputs, outputs, 3, padding=1)

    def forward(self, values: torch.Tensor, planes: int) -> torch.Tensor:
        values = functional.relu(self.first(values))
        most = values.unflatten(0, (-1, planes)).amax(1, keepdim=True)
        most = most.expand(-1, planes, -1, -1, -1).flatten(0, 1)
        return functional.relu(self.second(torch.cat([values, most], 1)))


def sharpness(stacks: torch.Tensor) -> torch.Tensor:
    """Return each picture's share of the stack's local contrast, (B, P, 1, H, W)."""
    grey = stacks.mean(2)
    contrast = (grey - functional.avg_pool2d(grey, 3, 1, 1)).abs()
    local = functional.avg_pool2d(contrast, 5, 1, 2)
    return (local / (local.sum(1, keepdim=True) + CONTRAST))[:, :, None]


class DepthFromFocus(nn.Module):
    """Returns dioptres (B, H, W) of stacks (B, P, 3, H, W) in [0, 1], focused at (P,) dioptres.

    A U-net scores each plane at each pixel, and corrects its dioptres; the answer is the mean by
    the softmax of scores.  H and W are multiples of 8.
    """

    def __init__(self) -> None:
        super().__init__()
        a, b, c = WIDTHS
        self.down = nn.ModuleList([Block(17, a), Block(a, b), Block(b, c)])
        self.up = nn.ModuleList([nn.Conv2d(c + b, b, 3, padding=1),
                                 nn.Conv2d(b + a, a, 3, padding=1)])  # fmt: skip
        self.out = nn.Conv2d(a, 8, 3, padding=1)

    def forward(self, stacks: torch.Tensor, focus: torch.Tensor) -> torch.Tensor:
        count, planes = stacks.shape[:2]
        given = torch.cat([stacks - 0.5, sharpness(stacks)], 2).flatten(0, 1)
        values = functional.pixel_unshuffle(given, 2)
        known = focus.repeat(count)[:, None, None, None].expand(-1, 1, *values.shape[2:])
        levels = [self.down[0](torch.cat([values, known], 1), planes)]
        for block in list(self.down)[1:]:
            levels.append(block(functional.avg_pool2d(levels[-1], 2), planes))
        values = levels.pop()
        for convolution in self.up:
            values = functional.interpolate(values, scale_factor=2.0)
            values = functional.relu(convolution(torch.cat([values, levels.pop()], 1)))
        fine = functional.pixel_shuffle(self.out(values), 2).unflatten(0, (count, planes))
        share = fine[:, :, 0].softmax(1)
        dioptres = functional.softplus(focus[:, None, None] + fine[:, :, 1], beta=10)
        return (share * dioptres).sum(1).clamp_min(LEAST)


def loss_of(found: torch.Tensor, true: torch.Tensor) -> torch.Tensor:
    return (torch.log(found + OFFSET) - torch.log(true + OFFSET)).abs().mean()


def trained(
    batches: Iterator[tuple[np.ndarray, np.ndarray]], focus: np.ndarray, steps: int, rate: float,
    seed: int,
) -> tuple[DepthFromFocus, list[float]]:  # fmt: skip
    """Train on batches of (codes (B, P, H, W, 3), dioptres (B, H, W)); return losses, too."""
    torch.manual_seed(seed)
    network, planes = DepthFromFocus(), torch.from_numpy(focus)
    network.to(memory_format=torch.channels_last)
    descent = torch.optim.Adam(network.parameters(), rate)
    cycle = torch.optim.lr_scheduler.OneCycleLR(descent, rate, total_steps=steps)
    losses = []
    for _, (codes, dioptres) in zip(range(steps), batches, strict=False):
        with torch.autocast("cpu", torch.bfloat16):  # half the seconds
            found = network(as_input(codes), planes)
        loss = loss_of(found.float(), torch.from_numpy(dioptres))
        descent.zero_grad()
        loss.backward()
        descent.step()
        cycle.step()
        losses.append(loss.item())
    return network, losses


def as_input(codes: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(np.moveaxis(codes, -1, -3).astype(np.float32) / 255)


def found(network: DepthFromFocus, codes: np.ndarray, focus: np.ndarray) -> np.ndarray:
    """Return dioptres (H, W) of one stack's codes (P, H, W, 3)."""
    with torch.inference_mode():
        return network(as_input(codes)[None], torch.from_numpy(focus))[0].numpy()


def weights(network: nn.Module) -> int:
    return sum(part.numel() for part in network.parameters())

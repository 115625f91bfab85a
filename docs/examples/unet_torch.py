"""A small U-Net that denoises frames, trained on a data set in PyTorch; it tells its loss.

    python docs/examples/unet_torch.py data/rooms --steps 200

Light is seen and learnt as log(1 + radiance), so that a lamp does not outweigh a room; the network
gives what to add to the noisy frame.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import torch  # pyright: ignore[reportMissingImports]
from torch import nn  # pyright: ignore[reportMissingImports]

import onespp


class UNet(nn.Module):
    """Three scales, 24 to 96 features; (n, 10, h, w) -> (n, 3, h, w), sides multiples of 4."""

    def __init__(self, inputs: int = 10, width: int = 24) -> None:
        super().__init__()
        self.down = nn.ModuleList([_block(inputs, width), _block(width, 2 * width),
                                   _block(2 * width, 4 * width)])
        self.up = nn.ModuleList([_block(6 * width, 2 * width), _block(3 * width, width)])
        self.last = nn.Conv2d(width, 3, 1)
        nn.init.zeros_(self.last.weight)  # it begins with the noisy frame
        nn.init.zeros_(self.last.bias)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        finer = []
        for i, block in enumerate(self.down):
            x = block(x if i == 0 else nn.functional.avg_pool2d(x, 2))
            finer.append(x)
        for block, skipped in zip(self.up, (finer[1], finer[0])):
            x = block(torch.cat([nn.functional.interpolate(x, scale_factor=2), skipped], 1))
        return self.last(x)


def _block(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(inputs, outputs, 3, padding=1), nn.ReLU(),
                         nn.Conv2d(outputs, outputs, 3, padding=1), nn.ReLU())


def batches(clips: onespp.Clips, size: int, workers: int) -> Iterator[dict[str, torch.Tensor]]:
    """Batches without end, shuffled, other crops and turns in each epoch."""
    loader = torch.utils.data.DataLoader(clips, batch_size=size, shuffle=True, num_workers=workers,
                                         drop_last=len(clips) >= size)
    epoch = 0
    while True:
        clips.set_epoch(epoch)
        yield from loader
        epoch += 1


def train(folder: str, steps: int, crop: int = 64, batch: int = 4, workers: int = 2) -> list[float]:
    """Trains and prints; the loss of each step as a share of that of its noisy frames."""
    torch.manual_seed(0)
    clips = onespp.Clips(folder, frames=1, crop=crop, channels=("color", "albedo", "normal",
                                                                "depth"))
    network = UNet()
    optimizer = torch.optim.Adam(network.parameters(), 1e-3)
    shares: list[float] = []
    for step, clip in zip(range(steps), batches(clips, batch, workers)):
        color, albedo, normal, truth = (clip[name][:, 0].movedim(-1, 1) for name in (
            "color", "albedo", "normal", "reference"))
        depth = clip["depth"]  # (n, 1, h, w): of one frame
        light = torch.log1p(color)
        inputs = torch.cat([light, albedo, normal, 1 / (1 + depth)], 1)
        loss = (light + network(inputs) - torch.log1p(truth)).abs().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        noisy = (light - torch.log1p(truth)).abs().mean().item()
        shares.append(loss.item() / noisy)
        if step % max(1, steps // 10) == 0 or step == steps - 1:
            print(f"step {step:4}: loss {loss.item():.4f} (noisy frames {noisy:.4f})")
    return shares


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", help="of a data set")
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--crop", type=int, default=64)
    arguments = parser.parse_args()
    train(arguments.folder, arguments.steps, arguments.crop)

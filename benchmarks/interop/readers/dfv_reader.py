"""Read a data set of focal stacks with DFV's own loader: SOURCE, FOLDER/ and output."""

import importlib.util
import sys

import numpy as np
import torch
import whole_torchvision  # noqa: F401

source, folder, out = sys.argv[1:]
spec = importlib.util.spec_from_file_location("FoD500", f"{source}/dataloader/FoD500.py")
module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
# Its training crops to 224 pixels; nothing is cropped for validation.
train, valid = module.FoD500Loader(folder)
valid.imglist_all, valid.imglist_dpt = train.imglist_all, train.imglist_dpt
stack, depth, focus = valid[0]
batch = next(iter(torch.utils.data.DataLoader(valid, batch_size=2)))
mean, std = valid.img_mean.reshape(3, 1, 1), valid.img_std.reshape(3, 1, 1)
np.savez(
    out,
    stack=np.rint(255 * (stack.numpy() * std + mean)).astype(np.uint8).transpose(0, 2, 3, 1),
    depth=depth.numpy()[0], focus=focus.numpy(), count=len(train), batch=batch[0].shape,
)  # fmt: skip

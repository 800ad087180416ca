"""Self-attention over all views of an object at once: what makes MVDream of Stable Diffusion (Shi et al. 2024)."""

from typing import Any

import torch

from diff3ds._shapes import Float, Tensor


class JoinedViews:
    """A processor of diffusers' self-attention in which every token attends to those of all views of its object.

    The views of an object follow one another in the batch.
    """

    def __init__(self, views: int) -> None:
        self.views = views

    def __call__(
        self,
        attn: Any,
        hidden_states: Float[Tensor, "B L C"],
        encoder_hidden_states: Tensor | None = None,
        attention_mask: Tensor | None = None,
        temb: Tensor | None = None,
    ) -> Float[Tensor, "B L C"]:
        """Attention of `attn`, a diffusers Attention without norm or residual of its own."""
        if encoder_hidden_states is not None or attention_mask is not None:
            raise RuntimeError("views are joined in self-attention without a mask only")
        rows, length, _ = hidden_states.shape
        joined = hidden_states.reshape(rows // self.views, self.views * length, -1)
        query, key, value = (
            project(joined).unflatten(-1, (attn.heads, -1)).transpose(1, 2)
            for project in (attn.to_q, attn.to_k, attn.to_v)
        )
        mixed = torch.nn.functional.scaled_dot_product_attention(query, key, value)
        mixed = mixed.transpose(1, 2).reshape(rows, length, -1)
        output: Tensor = attn.to_out[1](attn.to_out[0](mixed))
        return output


def join_views(unet: Any, views: int) -> None:
    """Joins the views in every self-attention of a UNet; attention to the text stays as it is."""
    processors = {
        name: JoinedViews(views) if name.endswith("attn1.processor") else processor
        for name, processor in unet.attn_processors.items()
    }
    # This empties the dictionary.
    unet.set_attn_processor(processors)


def check_joined(unet: Any) -> None:
    """Raises RuntimeError if views are not joined, as after slicing, fusing or xformers were switched on."""
    processors = {n: p for n, p in unet.attn_processors.items() if n.endswith("attn1.processor")}
    if not processors or not all(isinstance(p, JoinedViews) for p in processors.values()):
        raise RuntimeError("the UNet's self-attention was replaced: its views no longer see each other")

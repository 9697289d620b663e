"""The three baselines of the paper, behind the interface of ``pipeline.methods``.

All of them see what the engine sees: its keyframes, fused surfaces, masks and features. None has CLIP, SAM,
a language model or a LiDAR; each module says what it takes from its publication and what it cannot.
"""

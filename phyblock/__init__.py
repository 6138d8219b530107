"""phyblock: declarative runner for PhyBlock, 3D block assembly for vision-language models."""

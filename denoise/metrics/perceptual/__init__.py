"""Measures of what a viewer sees: FLIP and SSIM, and the filters both are made of."""

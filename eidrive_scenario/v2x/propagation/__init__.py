"""Path loss, shadowing and fading."""

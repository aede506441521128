"""Speed and turning-radius maps over the paper's gait family (13), like its Figs. 8 and 9."""

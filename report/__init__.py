"""What reports are drawn with: offline HTML, line drawings, 3-D playback; and where a command's outputs go."""

"""What reports are drawn with: offline HTML, line drawings, and 3-D playback."""

"""How a file is opened: by ffmpeg or PyAV, and which of its tracks."""

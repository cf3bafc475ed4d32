"""Scripts: lines with times, speakers and words, their file formats, and timecodes."""

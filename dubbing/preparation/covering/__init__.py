"""In which light a face stands, and what lies over it: by colours that are not usual."""

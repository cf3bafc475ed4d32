"""True dubs: films of the synthetic speaker whose dub has a true picture.

The speaker says sentence A and sentence B with the same motion, light, camera and noise. So the
film of A, dubbed with the sound of B, is compared with the film of B.
"""

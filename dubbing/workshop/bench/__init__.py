"""How fast is a person's model, on this machine and beside other tools?"""

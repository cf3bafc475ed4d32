"""Triangles of the face mesh: Delaunay's, of 468 points of a mean face from the front.

Those outside of the face's outline are left out.
"""

import base64
import zlib

import numpy as np

# Numbers of three points each, int16, compressed.
_PACKED = (
    "eNodlwlcj1kXx88J2ZKlJmtCSpZEdpFlSmGQEdlTCmmsZWmULaKxRBiaFFkrYwnJLmWtFBnzDjNmXmYMZn1nXmPG"
    "vIP3e59Pn/P9nXvv83+e5957zrlPRyVOd8hWOSqGh9AgrSnbpSbqrHO0hW7Q/8lq9dSR+r62h0G6Xd7XtvjtGPHE"
    "2mkz7S0fyaeyBn6OrbH8tXAtmiNz9AM9js3hbrPQDdgs/UiPynqN0+vwqMToEK2lw9WDO3vwHPMsD55Wg3dx1izU"
    "WfdLuByUCFkki2WI5nD9AT3GnY/pIbha5/Kec3WZxdUaAWNpfSDRMpC7RDOvaPkADpSuEiUXtKqexy7oXR3Gk9sz"
    "j2H6HvMaZnlu9Lmhpt2W/rZoez0rX8hE+Zf0llVyD10le6SVLJOPmWuOHGMNt8L16Hp0m+xRW92PfQo/Za6G69G/"
    "pLFWkxw9yCxidDCzD9IzrHm21BAz22y5LLYwix5b/FK5Ja1lPxou/5WLckG+Zx2eYN+zGpFoBNzINRvRCK6OxD+m"
    "J1mbRtx9AsxBt+kI/RidSM9gOESL4CRsMEzUBbqSNVmFN12rszIZkik9eV4GzJTNskt68DYXYA20BloTi4bdpB+r"
    "2hWNkgHytXwDu1prPQA/Gg6ktyn+DOku02Ud62bWbp2kSCNm8QRrJA0llr4U9qkWOzULGm8kUTdSaxF5/twlijv4"
    "Q3/GBsJZqJs2Zb+aspvntQN75gnd0GWop96SCjmH3bP4GVFawT5+JoVEa292sVBMBBfSX0jrHqywrinEnyR57HIe"
    "3irJZVe3sde5MBfNYZ9vkzW35Tpcjx5ix49a+z2PfZ6H2mpjrSrVZBr7XIv9ngabENvD9Rx6nndugt8EPa9V6DMx"
    "WcXyq7ILGcS+M5GRAUPVlni4g2bpTmi8nbpXr0ooDEVtZaqEkSP7xM2ioGGo8cPEBiZrbRW0tpZKf2KpVMqJlXLm"
    "ataonFX5Ak7E9lssRb2Ip8Xyk1yT+9JHRsivMhSdCkdY7aFygCd/SDx8KH/AP9DzchXaygui9QJ9L+Af8DKRdFg+"
    "wTKIqibihO+EPsPmwlxWKEdzsUPEbi7M1TX0jSd+J2ghOkFrkNkRMBa9pu/qbGwxXIxu1jx0M3E+gEgvJronEcdv"
    "5ZVMh9X1MveYQLRfhpfRIiJ+ITFfyVWvZBX6iqsqifxK1t9wFTpeq2kwNp5fv5VqsIc8JKYfEtUmsh8S2V/DnthF"
    "K18eMt+HZMYF6SiDyIxuaD/5N9nwDeyGNiMXvianmnF9MzzDTPKrKbpL/MiRGfzCjzj3w4uSTWTHXjJwE6Ob0Ia0"
    "N1n58i0Z8638QBUyukxcZQ4ZNIcRQ1dxkWSi+AfGkuESNBYmo67ymNHH0hg2Rlfy91jmybs8cTr0tzLtXTLsgo5h"
    "NcZQFe6qI7HqRl45qsk6R3LOkRFzhaOG8edI1jkyvkzXSCU5Uskp8Ln0IrJM9exF3rUgU9aTQS2snLlJ9rSAt8md"
    "XlSnXrqHallfemkDmaVLzEmh68ijdeSTLbZOP8SWWDzK6BLUXHMEHuFsMTxgnThHYDYje4iFbO6cjfcxvdmMZ6NH"
    "ydFNnEHzoPHmcc/uukt9NVnrkClrYDIMIAID0GRN04H6CTE5kNZAIvQTmIum8jtf3YL66lRqaYz+JTfI/BsaDaPR"
    "fWS0kt+qZy0mEnVKXyLtNlYtaENVaIOeszQIO2PxLLpQV3D9WW2O3xx/uVaRYqpKMSdJNaxY9moxOUc10AodrXbS"
    "U+vIL+Tnr7KCTC+FpdbpsAL2lx/J/TgyezE9d6SzTEMNV6A/ypdk9Jdof3lAfhv/AXyAxpDVV8juK+hVWCzmPa7g"
    "O0kauZxGZJpzIo3ITKPPMIP+DDRTntLzDMbx3Dj0GTX/Kf5TtCFjT+ELeU7NeE41MHxB1ZiLPoOr6VlNbhkeRseR"
    "j8FUgXGwBozVKLJ/M1UgCh7S3ex+HjTeHPw5aAuqwxRqxRS0EbyGPx5txO+n4C3WdOukTLfOzXTLy8NPZyRPt1JX"
    "fOAAtA9q/D7WrvfRvlgqfrbWJ7rqo6b+XNF/5Ap7MlrfyGWqzRi9SA5dRMPgWzF+NbSj7KROrIMpmCtsKs7UCmeq"
    "hakYztIcy4KPaDXn+kfk6SO0G+1H0E/eoWYsIONdsAXk+AKyPJZzawunXh68R3sLeb+F1iRLJ8lsqsgTbDa15S4Z"
    "abL1LrxLRuZKvkyQkzITPYXNpHVTbpCt1+F+vUGG7idbb0gD+ou4pghtwW+LYG/WyORyb7gN+pDRvWk7cBqajHAg"
    "LxzQ07pPBpFZg1AbmY/aSDddq511O5nYCasH66HdtR/r6wu3onW0IxnakdPMsDZnXar24Joe7ERPmIrac5XJU3sr"
    "k+25jz2tNLgdv6E66VjO46Fk61BaMbSHWm0nWg31MD2HyeYY7DD5m0IW/yUp2F7O3RTO3BQ0RPMZ38dYPsynLwTL"
    "p61qQ8bakK8mb23IWhv6Vlq6UuPRhZqA/iPx6HLa8bBCb3Pa3+Z0z7I0C7tK6ypaoZlYBmzOlZl4phpkwkjexFwT"
    "CXfCECIvkrabtOH0b8MpflAGS1sJktHs5EnqgiMn+C/QeGH4jvI76kjfb3iOcKj4kPU+1IEDZPgRsv4IWoUvgSPw"
    "CHpfqkoX6o8nNF4V/C70V5GvqBYxkoh1pr4kwkT6TM8dviOWUmUi4B2r+iylxwuaHi/uacbvc20nfvUlNN40/E60"
    "+lOhOsFpcAXvMJ+3mo/e55fzYRz0knQqxFzYhMqTjteEepGOvxoelt16gjpwgmqQB6Pwo9A88v8S9eASOg6Oo6aY"
    "VgRWA9aVPsRwH7Qv9d6Fyu+CHoPHrHx3gcI+mnwXKOzAaJ1MDZgEr6CRaAgWSeu1LOTL4428lgX4b6SI8dfwtRRb"
    "8fBa/mEsnghJ4qoFcBVfJkn8JhEvCdak3plvkprwIjTeRapKLLoMC4Px1Id5Ek9FMfUl3jrv462ex/h/ctqbGvIn"
    "/BNtLi35CliJ3xI6y27qzSa4C2tq0RndTd9eRnbDAGqOH3UrgC+VALx+PCXAau+klgVge7giAH5HNXKBs6k2jVEX"
    "vO/wvPk/5RZj3tQmb7xzVCVv6I0ukTJqSSV1p0zaY0W0ymiZOlMGU/HbY6nUJQdtQF1poEochskGKsnvMIzKEkht"
    "KaeqzNdTVJVu8DRZX8Z5nsxYGSxDO6srO1gfplk76wq9qDrdYR2r/nhBLypNHbWjupgKY0erI6wtdmJHjx2nbm2Z"
    "QU3bR72YAaPhaf5m8MQZVBTDw2iCbiR/N5K5yzVE3pc6mB1sKyPJ0FFU0VNU2FHU1VHoTTLwP5zXPtB4PmRmOHoQ"
    "m2pxKPpAfuas/gqaM/tnzv2faXmSzx3I5Q60PKEn66NoVewX65oOMIE+B9YrAXaAv2Ed6EtgFY2/AVUJVwfGw1nJ"
    "cFb7FhbOepfDW1g5/Unk9zUsiScn4f1ENUiCSain1edJfi4nZ5dzrhs+R5fTFwfjOOWfo8+kntQVH86MerAep0Z9"
    "2mMkBKtH/aqH1uXPXkylt2fdqPRivBB8e0ZCJF/foSpPhYOxfCvv3oGmNQmbDJN0FLn1Rkbxn8Bb+ApLsvhWCukb"
    "xXd+lrwkL16SE4YtrdyoTtzOhnux2fgvUdObZfW8RBcS20+whUT2IviEKF+I5w2N501/mZQQvSVoJd/EJXwVl6Dt"
    "Lf0cq4R9ie32WF95j7G++H3Rs/SMJ+YnwJPSjroexA5NJuYnow5wvhrfAf1bAon9cnQQVs5OrdWWRHtLor6z7uAk"
    "NKfhDs7DHlqXaK9LjBv2ILK90I6cu36cuX6cur5c5UfbH27nDO7Pd1A/uJV2f8vzY2wRuVOfkUV8/yzCG6FLifQE"
    "KNRDQROI+5mcYxthJu2ZeBVwNLYUBpIHgyWQU8ucXoH4At3IrUC8MXKc/T1OxhiORI/LWFZgJBokwURHfSyYOAnG"
    "MxkUDE0rn79gMiuYvlOs5BlW9Qx6Fp7lv91hrGcqnIIOp+80/nCrNY51HiuXuP8l1jtIbmop0X+T75fTsAFaipra"
    "ctPqOYUfqK1Y4VZ4hqXo39KK3uus/VpW/zoVqCUs066sfxr0Z1V3oNvVndm0ZbbuVkVwZ47utEydcYemZScnmO8Y"
    "OJp3O4E3mvYJ3nIcND3j8M+IB7PwQCfyBeAB28D9tH2Z+3BovFR8X+aaCodb8w9lzqHcwcw8lPuEMu+xvH0J8yhh"
    "Nn9LCWYqQAkRZfoaaAFzWcvMC6ATHIudgovUm4hwhWaOXZhlFyLFH+tClHRhfIB6SAHvWcDTT2MFvEEBzzTvUcCT"
    "C9Sde1+HAZgTX2ju3NsJTrP+L3OHrbn/Iu7WGrZGu8KuPNEbTdMCGcJ9hnA3D0vb8TeEuBrCehh6oP8HEhffAw=="
)


def unpacked() -> np.ndarray:
    """Triangles (M, 3) int64: numbers of their points."""
    raw = zlib.decompress(base64.b64decode(_PACKED))
    return np.frombuffer(raw, "<i2").reshape(-1, 3).astype(np.int64)


TRIANGLES = unpacked()

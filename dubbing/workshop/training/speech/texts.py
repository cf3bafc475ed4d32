"""Texts for the synthesisers: a few everyday sentences a language, words drawn in random order.

Random order gives every pair of sounds a chance and teaches no grammar, which a lip does not
follow anyway. The English list is chosen for its sounds, not for its sense.
"""

import numpy as np

ENGLISH = """
the birch canoe slid on smooth planks glue sheet to dark blue background it is easy to tell depth
of well these days chicken leg rare dish rice often served in round bowls juice lemons makes fine
punch box thrown beside parked truck hogs fed chopped corn and garbage four hours steady work faced
us large size stockings hard sell boy was there when sun rose rod used catch pink salmon source huge
river clear spring kick ball straight follow through help woman get back her feet pot tea helps pass
evening smoky fires lack flame heat soft cushion broke man's fall salt breeze came across from sea
girl at booth sold fifty bonds small pup gnawed hole sock fish twisted turned bent hook press pants
sew button vest swan dive far short perfect beauty view stunned young both tops ripped shook choice
measure vision pleasure treasure azure beige usual garage thing thumb bath breathe mother father
weather either feather theatre thought young yellow yes yet year you use music cute value view few
why whale wheel where when while water window winter wonder wolf would could should good book foot
look pull full push bush put food moon soon group shoe blue true fruit suit choose lose loop spoon
boy toy noise voice point join coin oil enjoy royal loyal cow now how house mouse south mouth shout
loud cloud proud about around found my eye high light night right time five nine drive price wise
day way say may rain train name game make take face place space page change stage ago boat coat road
home stone phone vote most only open over also total hotel car far hard start part large march heart
father palm calm law saw draw call ball tall small talk walk thought bought caught ought bird word
world work first nurse church purple turn learn early certain person hurry current cat hat map lamp
black happy apple family plan bed red head bread said many any friend help melt sentence sit ship
fish miss visit minute system middle see tree green people machine believe evening even police cup
luck love money monday sunday young country blood much such judge jungle jump january june july joke
giant general magic engine badge bridge age chair child chance cheese match watch kitchen nature
picture teacher future question shop shy shoulder sugar sure station nation ocean patient mission
vase very vivid never seven eleven heaven give live move prove above zero zoo zebra lazy crazy easy
busy reason season present husband nose rose please because goose glass grey green grow big bag dog
egg flag fog ugly garden king ring song long wrong young bank think drink finger hungry language
probably problem bubble baby maybe robot member number remember memory summer mummy moment women
maximum people pepper paper purpose puppet popcorn happen open copper report repeat february
business information important development government experience international communication
opportunity responsibility university technology environment particularly approximately
"""

# A few sentences each, as people say them; espeak-ng reads the spelling.
LANGUAGES: dict[str, str] = {
    "en-us": ENGLISH,
    "en-gb-x-rp": ENGLISH,
    "de": """guten Morgen meine Damen und Herren heute sprechen wir über das schöne Wetter
        im Süden fünf große Züge fahren jeden Tag durch die Stadt der Junge möchte ein Glas
        Milch trinken könnten Sie mir bitte sagen wie spät es ist die Bücher liegen auf dem
        Tisch neben der Tür wir freuen uns euch bald wieder zu sehen früher war vieles
        anders zwölf Jahre später""",
    "fr": """bonjour mesdames et messieurs aujourd'hui nous parlons du beau temps dans le
        sud un jeune homme voudrait boire un verre d'eau fraîche les enfants jouent dans le
        jardin depuis ce matin je ne sais pas où se trouve la gare combien coûte ce livre
        bleu nous sommes heureux de vous voir bientôt une bonne nouvelle pour tout le monde
        peut-être deux heures plus tard""",
    "it": """buongiorno signore e signori oggi parliamo del bel tempo nel sud un giovane
        vorrebbe bere un bicchiere d'acqua fresca i bambini giocano nel giardino da questa
        mattina non so dove si trova la stazione quanto costa questo libro azzurro siamo
        felici di vedervi presto gli amici della famiglia mangiano spesso gnocchi e pesce
        già cinque anni fa""",
    "es": """buenos días señoras y señores hoy hablamos del buen tiempo en el sur un joven
        quisiera beber un vaso de agua fresca los niños juegan en el jardín desde esta
        mañana no sé dónde está la estación cuánto cuesta este libro azul nos alegramos de
        verlos pronto mucha gente viaja lejos cada año porque quiere conocer otras ciudades""",
    "pt": """bom dia senhoras e senhores hoje falamos do bom tempo no sul um jovem gostaria
        de beber um copo de água fresca as crianças brincam no jardim desde esta manhã não
        sei onde fica a estação quanto custa este livro azul ficamos felizes em vê-los em
        breve muita gente viaja longe todos os anos porque quer conhecer outras cidades""",
    "nl": """goedemorgen dames en heren vandaag spreken we over het mooie weer in het zuiden
        een jongen wil graag een glas fris water drinken de kinderen spelen sinds vanochtend
        in de tuin ik weet niet waar het station is hoeveel kost dit blauwe boek we zijn
        blij u gauw te zien""",
    "sv": """god morgon mina damer och herrar idag talar vi om det vackra vädret i söder en
        ung man vill gärna dricka ett glas kallt vatten barnen leker i trädgården sedan i
        morse jag vet inte var stationen ligger vad kostar den här blå boken vi är glada att
        få se er snart sju sjuka sjömän köper kött""",
    "da": """godmorgen mine damer og herrer i dag taler vi om det smukke vejr i syd en ung
        mand vil gerne drikke et glas koldt vand børnene leger i haven siden i morges jeg
        ved ikke hvor stationen ligger hvad koster den blå bog vi glæder os til at se jer
        snart""",
    "pl": """dzień dobry panie i panowie dzisiaj mówimy o pięknej pogodzie na południu młody
        człowiek chciałby wypić szklankę zimnej wody dzieci bawią się w ogrodzie od samego
        rana nie wiem gdzie jest dworzec ile kosztuje ta niebieska książka cieszymy się że
        wkrótce się zobaczymy""",
    "cs": """dobrý den dámy a pánové dnes mluvíme o krásném počasí na jihu mladý muž by si
        rád dal sklenici studené vody děti si od rána hrají na zahradě nevím kde je nádraží
        kolik stojí tato modrá kniha těšíme se že se brzy uvidíme čtyři řeky tečou přes
        město""",
    "ru": """доброе утро дамы и господа сегодня мы говорим о хорошей погоде на юге молодой
        человек хотел бы выпить стакан холодной воды дети с утра играют в саду я не знаю где
        находится вокзал сколько стоит эта синяя книга мы будем рады скоро вас увидеть
        большое спасибо""",
    "uk": """доброго ранку пані та панове сьогодні ми говоримо про гарну погоду на півдні
        молодий чоловік хотів би випити склянку холодної води діти зранку граються в саду я
        не знаю де вокзал скільки коштує ця синя книга ми будемо раді скоро вас побачити""",
    "el": """καλημέρα κυρίες και κύριοι σήμερα μιλάμε για τον ωραίο καιρό στο νότο ένας νέος
        θέλει να πιει ένα ποτήρι κρύο νερό τα παιδιά παίζουν στον κήπο από το πρωί δεν ξέρω
        πού είναι ο σταθμός πόσο κάνει αυτό το μπλε βιβλίο χαιρόμαστε που θα σας δούμε
        σύντομα""",
    "tr": """günaydın bayanlar ve baylar bugün güneydeki güzel havadan söz ediyoruz genç bir
        adam bir bardak soğuk su içmek istiyor çocuklar sabahtan beri bahçede oynuyor
        istasyonun nerede olduğunu bilmiyorum bu mavi kitap kaç para yakında sizi
        göreceğimiz için mutluyuz""",
    "hu": """jó reggelt hölgyeim és uraim ma a szép déli időről beszélünk egy fiatal férfi
        szeretne inni egy pohár hideg vizet a gyerekek reggel óta a kertben játszanak nem
        tudom hol van az állomás mennyibe kerül ez a kék könyv örülünk hogy hamarosan
        találkozunk""",
    "fi": """hyvää huomenta hyvät naiset ja herrat tänään puhumme kauniista säästä etelässä
        nuori mies haluaisi juoda lasin kylmää vettä lapset leikkivät puutarhassa aamusta
        asti en tiedä missä asema on paljonko tämä sininen kirja maksaa olemme iloisia kun
        näemme teidät pian""",
    "ro": """bună dimineața doamnelor și domnilor astăzi vorbim despre vremea frumoasă din
        sud un tânăr ar vrea să bea un pahar cu apă rece copiii se joacă în grădină de azi
        dimineață nu știu unde este gara cât costă această carte albastră ne bucurăm să vă
        vedem curând""",
    "hi": """नमस्ते देवियों और सज्जनों आज हम दक्षिण के अच्छे मौसम के बारे में बात करते हैं
        एक युवक ठंडा पानी पीना चाहता है बच्चे सुबह से बगीचे में खेल रहे हैं मुझे नहीं पता कि
        स्टेशन कहाँ है यह नीली किताब कितने की है""",
    "id": """selamat pagi ibu dan bapak hari ini kita berbicara tentang cuaca yang baik di
        selatan seorang pemuda ingin minum segelas air dingin anak-anak bermain di kebun
        sejak pagi saya tidak tahu di mana stasiun berapa harga buku biru ini kami senang
        segera bertemu""",
    "sw": """habari za asubuhi mabibi na mabwana leo tunazungumza kuhusu hali nzuri ya hewa
        kusini kijana mmoja angependa kunywa glasi ya maji baridi watoto wanacheza bustanini
        tangu asubuhi sijui kituo kiko wapi kitabu hiki cha bluu kinauzwa bei gani""",
    "vi": """chào buổi sáng các ông các bà hôm nay chúng ta nói về thời tiết đẹp ở miền nam
        một chàng trai muốn uống một cốc nước lạnh trẻ em chơi trong vườn từ sáng tôi không
        biết nhà ga ở đâu quyển sách màu xanh này giá bao nhiêu""",
    "cmn": """早上好 女士们 先生们 今天 我们 谈谈 南方 的 好 天气 一个 年轻人 想 喝 一杯
        冷水 孩子们 从 早上 就 在 花园 里 玩 我 不 知道 火车站 在 哪里 这本 蓝色 的 书 多少
        钱 我们 很 高兴 很快 见到 你们""",
}


def sentence(language: str, rng: np.random.Generator, words: int) -> str:
    """Words of a language in random order, with commas now and then and a full stop."""
    known = LANGUAGES[language].split()
    chosen = [known[k] for k in rng.integers(len(known), size=words)]
    marked = [w + "," if rng.random() < 0.12 else w for w in chosen[:-1]]
    return " ".join([*marked, chosen[-1]]) + "."

//! Names that files give to coordinates, colours and attributes, in the languages that surveyors export.
//!
//! Names are compared in [plain](plain) spelling: lower case, letters and digits only, without accents. Each string is
//! a list of such spellings in one group of languages, separated by blanks.

/// Names of longitudes, which are in degrees.
pub(super) const LONGITUDES: &str = "longitude lon long lng longitud longitudine laenge lange laengengrad langengrad \
    geographischelange geographischelaenge lengtegraad lengdegrad langdgrad pituusaste dlugosc dlugoscgeograficzna \
    zemepisnadelka boylam долгота довгота 经度 經度 経度 경도";

/// Names of latitudes, which are in degrees.
pub(super) const LATITUDES: &str = "latitude lat latitud latitudine breite breitengrad geographischebreite breedtegraad breddegrad breddgrad \
    leveysaste szerokosc szerokoscgeograficzna zemepisnasirka enlem широта 纬度 緯度 위도";

/// Names of x, y and z, the likeliest first. Whatever letters a country's surveyors use, x is east and y is north.
pub(super) const AXES: [&[&str]; 3] = [
    &[
        "x xcoord xcoordinate coordx coordinatex coordenadax xkoordinate xkoordinaat posx positionx px points0",
        "easting eastings east e ecoord ecoordinate",
        "rechtswert rechts ostwert ost ostkoordinate rw",       // German
        "est coordonneeest abscisse este coordenadaeste leste", // French, Italian, Spanish, Portuguese, Romanian
        "oost oosting oostwaarde ostlig osting øst ita itakoordinaatti", // Dutch, Scandinavian, Finnish
        "wschod wschodnia vychod istok vzhod kelet восток восточная восточный схід", // Slavic, Hungarian
        "dogu saga sagadeger",                                  // Turkish
        "东 东坐标 东向 东距 东方向 横坐标 x坐标 東 東坐標 東距 東座標 橫坐標 x座標 동 동쪽 동거 x좌표",
        LONGITUDES,
    ],
    &[
        "y ycoord ycoordinate coordy coordinatey coordenaday ykoordinate ykoordinaat posy positiony py points1",
        "northing northings north n ncoord ncoordinate",
        "hochwert hoch nordwert nord nordkoordinate hw", // German
        "coordonneenord ordonnee norte coordenadanorte", // French, Spanish, Portuguese
        "noord noording noordwaarde nordlig nording norr pohjoinen pohjoiskoordinaatti", // Dutch, Scandinavian, Finnish
        "polnoc polnocna sever sjever eszak север северная северный північ", // Slavic, Hungarian
        "kuzey yukari yukarideger",                      // Turkish
        "北 北坐标 北向 北距 北方向 纵坐标 y坐标 北坐標 北座標 縱坐標 y座標 북 북쪽 북거 y좌표",
        LATITUDES,
    ],
    &[
        "z zcoord zcoordinate coordz coordinatez coordenadaz zkoordinate zkoordinaat posz positionz pz points2",
        "elevation elev ele height altitude alt h hgt up reducedlevel",
        "hohe hoehe hohenwert hoehenwert meereshohe kote", // German
        "hauteur cote cota altura altitud elevacion elevacao alzado", // French, Spanish, Portuguese
        "quota altezza altitudine elevazione",             // Italian
        "hoogte hojd hojde hoyde højde høyde korkeus",     // Dutch, Scandinavian, Finnish
        "wysokosc rzedna vyska nadmorskavyska visina magassag высота отметка висота", // Slavic, Hungarian
        "yukseklik kot",                                   // Turkish
        "高程 高 高度 标高 海拔 z坐标 標高 高さ z座標 높이 표고 고도 z좌표",
    ],
];

/// Words beside an axis that make it part of something other than a position: `normal_x`, `velocity y`.
pub(super) const NO_POSITION: &str = "n normal normals norm v vel velocity speed a acc accel acceleration d dir \
    direction sigma std stddev sd err error accuracy precision rms var variance cov rot rotation angle gyro mag scale \
    offset shift index pixel image texture uv";

/// Names of the three channels of a colour. If a file has several colours, the first in this list is taken.
pub(super) const COLORS: &[&str] = &[
    "red green blue",
    "diffusered diffusegreen diffuseblue",
    "r g b",
    "colorred colorgreen colorblue",
    "colourred colourgreen colourblue",
    "colorr colorg colorb",
    "rf gf bf",
    "rot grun blau",
    "rot gruen blau",
    "rouge vert bleu",
    "rojo verde azul",
    "rosso verde blu",
    "vermelho verde azul",
    "rood groen blauw",
    "rod gron bla",
    "rød grønn bla",
    "rød grøn bla",
    "punainen vihrea sininen",
    "czerwony zielony niebieski",
    "cervena zelena modra",
    "crvena zelena plava",
    "piros zold kek",
    "kirmizi yesil mavi",
    "красный зеленый синий",
    "червоний зелений синій",
    "红 绿 蓝",
    "红色 绿色 蓝色",
    "紅 綠 藍",
    "赤 緑 青",
    "빨강 초록 파랑",
];

/// Attributes: PDAL's name, and the plain names that files use.
pub(super) const FIELDS: &[(&str, &str)] = &[
    (
        "Intensity",
        "intensity intensities i intensitat intensitaet intensite intensidad intensidade intensita intensiteit \
         intensitet intensiteetti intensywnosc natezenie intenzita intenzitet intenzitas yogunluk интенсивность \
         інтенсивність 强度 反射强度 強度 反射強度 강도",
    ),
    (
        "Classification",
        "classification class klassifikation klassifizierung klasse classe clase clasificacion classificacao \
         classificazione klassificering klass klasyfikacja klasa klasifikace trida sinif класс классификация 分类 类别 \
         分類 クラス 분류",
    ),
    ("ReturnNumber", "returnnumber"),
    ("NumberOfReturns", "numberofreturns"),
    ("ScanDirectionFlag", "scandirectionflag"),
    ("EdgeOfFlightLine", "edgeofflightline"),
    ("ScanAngleRank", "scananglerank"),
    ("ScanChannel", "scanchannel"),
    ("UserData", "userdata"),
    ("PointSourceId", "pointsourceid"),
    ("GpsTime", "gpstime"),
    ("Infrared", "infrared nir"),
    ("Alpha", "alpha a"),
    ("NormalX", "nx normalx"),
    ("NormalY", "ny normaly"),
    ("NormalZ", "nz normalz"),
    ("Curvature", "curvature"),
    ("Ring", "ring"),
];

/// A name for comparison: lower case, letters and digits only, without accents.
pub(super) fn plain(name: &str) -> String {
    name.chars().flat_map(char::to_lowercase).map(without_accent).filter(|c| c.is_alphanumeric()).collect()
}

/// The letter below an accent, in the alphabets of the names above. Accents that follow their letter are no letters.
fn without_accent(c: char) -> char {
    match c {
        'à' | 'á' | 'â' | 'ã' | 'ä' | 'å' | 'ă' | 'ą' => 'a',
        'ç' | 'ć' | 'č' => 'c',
        'ď' | 'đ' => 'd',
        'è' | 'é' | 'ê' | 'ë' | 'ę' | 'ě' => 'e',
        'ğ' => 'g',
        'ì' | 'í' | 'î' | 'ï' | 'ı' => 'i',
        'ł' => 'l',
        'ñ' | 'ń' | 'ň' => 'n',
        'ò' | 'ó' | 'ô' | 'õ' | 'ö' | 'ő' => 'o',
        'ř' => 'r',
        'ś' | 'š' | 'ş' | 'ș' => 's',
        'ť' | 'ț' => 't',
        'ù' | 'ú' | 'û' | 'ü' | 'ű' | 'ů' => 'u',
        'ý' => 'y',
        'ź' | 'ż' | 'ž' => 'z',
        'ё' => 'е',
        _ => c,
    }
}

/// Whether a plain name is in a list.
pub(super) fn contains(list: &str, plain: &str) -> bool {
    list.split_ascii_whitespace().any(|name| name == plain)
}

/// PDAL's name of an attribute, if there is one for a plain name.
pub(super) fn field(plain: &str) -> Option<&'static str> {
    FIELDS.iter().find(|(_, names)| contains(names, plain)).map(|(name, _)| *name)
}

/// The axis that a plain name is one of, and its place among the names of that axis; names with a lower place are
/// likelier.
pub(super) fn axis(plain: &str) -> Option<(usize, usize)> {
    AXES.iter().enumerate().find_map(|(axis, lists)| {
        let place = lists.iter().flat_map(|list| list.split_ascii_whitespace()).position(|name| name == plain)?;
        Some((axis, place))
    })
}

/// The words of a name, in plain spelling: `Target_Easting`, `posX` and `CENTROID-LON` have two.
pub(super) fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut lower = false;
    for c in name.chars() {
        if !c.is_alphanumeric() || lower && c.is_uppercase() {
            words.push(String::new());
        }
        lower = c.is_lowercase();
        if let Some(word) = words.last_mut() {
            word.push_str(&plain(c.encode_utf8(&mut [0; 4])));
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

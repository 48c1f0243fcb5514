use glam::DVec3;

use super::*;
use crate::Error;

/// Points of a class, with flags and returns.
fn cloud() -> PointCloud {
    let field = |cloud: PointCloud, (name, values): (&str, Vec<u8>)| {
        cloud.with_field(name, FieldValues::U8(values)).expect("a value each")
    };
    let fields = [
        ("Classification", vec![2, 6, 7, 18, 12, 3, 1]),
        ("Withheld", vec![0, 0, 1, 0, 0, 1, 0]),
        ("Overlap", vec![1, 0, 0, 0, 0, 0, 0]),
        ("ReturnNumber", vec![1, 1, 2, 1, 2, 3, 1]),
        ("NumberOfReturns", vec![1, 2, 2, 1, 3, 3, 1]),
    ];
    let positions = (0..7).map(|x| [x as f32, 0.0, 0.0]).collect();
    fields.into_iter().fold(PointCloud::new(DVec3::ZERO, positions), field)
}

fn kept(filter: &str) -> Vec<usize> {
    let filter: PointFilter = filter.parse().unwrap_or_else(|error| panic!("{filter}: {error}"));
    let mut cloud = cloud();
    cloud.keep(&filter);
    cloud.positions().iter().map(|position| position[0] as usize).collect()
}

#[test]
fn words_choose_points() {
    for (filter, expected) in [
        ("all", &[0, 1, 2, 3, 4, 5, 6][..]),
        ("usual", &[0, 1, 4, 6]),
        ("-noise,-withheld", &[0, 1, 4, 6]),
        ("ground", &[0]),
        ("Ground, BUILDINGS", &[0, 1]),
        ("2..6", &[0, 1, 5]),
        ("-2..6", &[2, 3, 4, 6]),
        ("low-noise", &[2]),
        ("low point (noise)", &[2]),
        ("high_noise", &[3]),
        ("noise,-withheld", &[3]),
        ("noise,withheld", &[2]),
        ("withheld", &[2, 5]),
        ("overlap", &[0, 4]),
        ("-overlap,-noise", &[1, 5, 6]),
        ("12", &[4]),
        ("first", &[0, 1, 3, 6]),
        ("last-returns", &[0, 2, 3, 5, 6]),
        ("single", &[0, 3, 6]),
        ("return:2", &[2, 4]),
        ("return:2..3,-withheld", &[4]),
        ("-first", &[2, 4, 5]),
        ("vegetation,unclassified", &[5, 6]),
        ("200", &[]),
    ] {
        assert_eq!(kept(filter), expected, "{filter}");
    }
}

#[test]
fn what_is_left_out_is_told() {
    let told = |filter: &str| filter.parse::<PointFilter>().expect("a filter").left_out(&cloud()).to_string();
    assert_eq!(told("usual"), "3 of 7 points: 1 low noise (class 7), 1 high noise (class 18), 1 withheld");
    assert_eq!(told("ground,first"), "6 of 7 points: 6 others");
    assert_eq!(told("all"), "0 of 7 points");
    assert_eq!(told("-65"), "0 of 7 points", "no such class is there");
}

#[test]
fn what_is_left_out_of_parts_is_told_like_that_of_the_whole() {
    let whole = cloud();
    for words in ["usual", "-withheld,-noise", "ground,-withheld", "2..7,first", "all", "-first,-last"] {
        let filter: PointFilter = words.parse().expect("a filter");
        let part = |range: std::ops::Range<usize>| {
            let mut part = whole.clone();
            part.retain(|i| range.contains(&i));
            filter.left_out(&part)
        };
        let expected = filter.left_out(&whole);
        for at in 0..=whole.len() {
            // The reasons of a part may be those of the whole that come last.
            let found = LeftOut::counts(&[part(0..at), part(at..whole.len())], &filter);
            assert_eq!((found.count(), found.to_string()), (expected.count(), expected.to_string()), "{words} at {at}");
        }
    }
}

#[test]
fn other_words_are_refused() {
    for (bad, why) in [
        ("grond", "'grond' is no class, flag or return"),
        ("", "no class"),
        ("ground,", "no class"),
        ("all,ground", "alone"),
        ("-usual", "alone"),
        ("6..2", "must be a class"),
        ("2-5", "must be a class"),
        ("return:x", "return:N"),
        ("--force", "'-force' is no class"),
        ("5000000000", "must be a class"),
    ] {
        let error = bad.parse::<PointFilter>().expect_err("it means nothing");
        assert!(matches!(error, Error::BadFilter { .. }) && error.to_string().contains(why), "{bad}: {error}");
    }
    assert!("1,".repeat(300).parse::<PointFilter>().is_err(), "there is an end");
    let filter: PointFilter = " Ground , -7 ".parse().expect("a filter");
    assert_eq!(filter.to_string(), "ground,-7", "the same words again");
    assert_eq!(filter.to_string().parse::<PointFilter>().ok(), Some(filter));
}

#[test]
fn fields_have_several_names_and_types() {
    let with = |name: &str, values| PointCloud::new(DVec3::ZERO, vec![[0.0; 3]; 3]).with_field(name, values);
    let ground: PointFilter = "ground".parse().expect("a filter");
    for name in ["Classification", "scalar_Classification", "class", "LABEL", "scalar_Label"] {
        for values in [
            FieldValues::U8(vec![2, 1, 2]),
            FieldValues::I32(vec![2, -1, 2]),
            FieldValues::F32(vec![2.0, f32::NAN, 2.0]),
            FieldValues::U64(vec![2, u64::MAX, 2]),
        ] {
            let mut cloud = with(name, values).expect("a value each");
            assert_eq!(ground.missing_field(&cloud), None, "{name}");
            cloud.keep(&ground);
            assert_eq!(cloud.len(), 2, "{name}");
        }
    }
    let cloud = with("Intensity", FieldValues::U8(vec![2; 3])).expect("a value each");
    assert_eq!(ground.missing_field(&cloud), Some("Classification"), "there are no classes");
    let missing = |filter: &str| filter.parse::<PointFilter>().expect("a filter").missing_field(&cloud);
    assert_eq!(missing("-withheld"), Some("Withheld"));
    assert_eq!(missing("last"), Some("ReturnNumber"));
    assert_eq!((missing("usual"), missing("all")), (None, None), "nothing is needed");
    assert_eq!(ground.left_out(&cloud).count(), 3, "the class is 0");
    for (name, noise) in [("scalar_Classification", 3), ("class", 0), ("label", 0)] {
        let cloud = with(name, FieldValues::U8(vec![7; 3])).expect("a value each");
        assert_eq!(PointFilter::usual().left_out(&cloud).count(), noise, "{name}");
    }
    assert_eq!("0,-withheld".parse::<PointFilter>().expect("a filter").left_out(&cloud).count(), 0, "the class is 0");
}

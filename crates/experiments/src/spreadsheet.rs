//! Tables for spreadsheets.

/// As CSV, quoted where a cell needs it. Every row has as many cells as the header.
pub(crate) fn to_csv(header: &[impl AsRef<[u8]>], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record(header).expect("memory takes all, and all rows are as long as the header");
    for row in rows {
        csv.write_record(&row).expect("memory takes all, and all rows are as long as the header");
    }
    String::from_utf8(csv.into_inner().expect("memory takes all")).expect("made of text")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_quoted_where_they_need_it() {
        let row = ["a, b", "say \"c\"", "d", ""].map(String::from).to_vec();
        assert_eq!(to_csv(&["1", "2", "3", "4"], [row]), "1,2,3,4\n\"a, b\",\"say \"\"c\"\"\",d,\n");
    }
}

//! Columns of Arrow as numbers, whatever their type: NaN if a row has no value.

use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Date32Type, Date64Type, Decimal32Type, Decimal64Type, Decimal128Type, Decimal256Type,
    Float16Type, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, Time32MillisecondType,
    Time64MicrosecondType, Time64NanosecondType, TimestampMicrosecondType, TimestampMillisecondType,
    TimestampNanosecondType, TimestampSecondType, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef, RecordBatch};
use arrow_schema::{DataType, TimeUnit};

/// The columns of a batch by name; those of a struct by their path.
pub(super) fn leaves(batch: &RecordBatch) -> Vec<(String, ArrayRef)> {
    let mut leaves = Vec::new();
    for (field, array) in batch.schema().fields().iter().zip(batch.columns()) {
        flatten(field.name(), array, &mut leaves);
    }
    leaves
}

fn flatten(name: &str, array: &ArrayRef, leaves: &mut Vec<(String, ArrayRef)>) {
    match array.as_struct_opt() {
        Some(of) => {
            for (field, inner) in of.fields().iter().zip(of.columns()) {
                flatten(&format!("{name}.{}", field.name()), inner, leaves);
            }
        }
        None => leaves.push((name.to_string(), array.clone())),
    }
}

/// How many numbers a row of lists holds: the most of these rows. None where the column has no lists.
pub(super) fn width(array: &ArrayRef) -> Option<usize> {
    let longest = |lengths: &mut dyn Iterator<Item = usize>| Some(lengths.max().unwrap_or(0));
    match array.data_type() {
        DataType::List(_) => longest(&mut array.as_list::<i32>().offsets().lengths()),
        DataType::LargeList(_) => longest(&mut array.as_list::<i64>().offsets().lengths()),
        DataType::FixedSizeList(_, size) => usize::try_from(*size).ok(),
        _ => None,
    }
}

/// The numbers of a column; of a column of lists as many columns as `width`.
pub(super) fn numbers(array: &ArrayRef, width: usize) -> Vec<Vec<f64>> {
    let (values, begin): (&ArrayRef, Vec<usize>) = match array.data_type() {
        DataType::List(_) => {
            let list = array.as_list::<i32>();
            (list.values(), list.offsets().iter().map(|at| *at as usize).collect())
        }
        DataType::LargeList(_) => {
            let list = array.as_list::<i64>();
            (list.values(), list.offsets().iter().map(|at| *at as usize).collect())
        }
        DataType::FixedSizeList(..) => {
            let list = array.as_fixed_size_list();
            let begin = (0..=list.len()).map(|row| row * list.value_length() as usize);
            (list.values(), begin.collect())
        }
        _ => return vec![scalars(array)],
    };
    let values = scalars(values);
    let of_row = |row: usize, k: usize| {
        let at = begin[row] + k;
        if at < begin[row + 1] && array.is_valid(row) { values[at] } else { f64::NAN }
    };
    (0..width).map(|k| (0..array.len()).map(|row| of_row(row, k)).collect()).collect()
}

/// A column without lists: times in s, not a number of what is not a number.
fn scalars(array: &ArrayRef) -> Vec<f64> {
    match array.data_type() {
        DataType::Float64 => of::<Float64Type>(array, |x| x),
        DataType::Float32 => of::<Float32Type>(array, f64::from),
        DataType::Float16 => of::<Float16Type>(array, f64::from),
        DataType::Int8 => of::<Int8Type>(array, f64::from),
        DataType::Int16 => of::<Int16Type>(array, f64::from),
        DataType::Int32 => of::<Int32Type>(array, f64::from),
        DataType::Int64 => of::<Int64Type>(array, |x| x as f64),
        DataType::UInt8 => of::<UInt8Type>(array, f64::from),
        DataType::UInt16 => of::<UInt16Type>(array, f64::from),
        DataType::UInt32 => of::<UInt32Type>(array, f64::from),
        DataType::UInt64 => of::<UInt64Type>(array, |x| x as f64),
        DataType::Decimal32(_, scale) => of::<Decimal32Type>(array, |x| f64::from(x) / ten_to(*scale)),
        DataType::Decimal64(_, scale) => of::<Decimal64Type>(array, |x| x as f64 / ten_to(*scale)),
        DataType::Decimal128(_, scale) => of::<Decimal128Type>(array, |x| x as f64 / ten_to(*scale)),
        // Its digits are more than a double has: they are read as a text.
        DataType::Decimal256(_, scale) => {
            of::<Decimal256Type>(array, |x| x.to_string().parse::<f64>().unwrap_or(f64::NAN) / ten_to(*scale))
        }
        DataType::Timestamp(TimeUnit::Second, _) => of::<TimestampSecondType>(array, |x| x as f64),
        DataType::Timestamp(TimeUnit::Millisecond, _) => {
            of::<TimestampMillisecondType>(array, |x| seconds(x, 1_000))
        }
        DataType::Timestamp(TimeUnit::Microsecond, _) => {
            of::<TimestampMicrosecondType>(array, |x| seconds(x, 1_000_000))
        }
        DataType::Timestamp(TimeUnit::Nanosecond, _) => {
            of::<TimestampNanosecondType>(array, |x| seconds(x, 1_000_000_000))
        }
        DataType::Time32(TimeUnit::Millisecond) => {
            of::<Time32MillisecondType>(array, |x| seconds(x.into(), 1_000))
        }
        DataType::Time64(TimeUnit::Microsecond) => {
            of::<Time64MicrosecondType>(array, |x| seconds(x, 1_000_000))
        }
        DataType::Time64(TimeUnit::Nanosecond) => {
            of::<Time64NanosecondType>(array, |x| seconds(x, 1_000_000_000))
        }
        DataType::Date32 => of::<Date32Type>(array, |x| 86_400.0 * f64::from(x)),
        DataType::Date64 => of::<Date64Type>(array, |x| seconds(x, 1_000)),
        DataType::Boolean => {
            let truths = array.as_boolean().iter();
            truths.map(|x| x.map_or(f64::NAN, |x| f64::from(u8::from(x)))).collect()
        }
        _ => vec![f64::NAN; array.len()],
    }
}

fn of<T: ArrowPrimitiveType>(array: &ArrayRef, number: impl Fn(T::Native) -> f64) -> Vec<f64> {
    array.as_primitive::<T>().iter().map(|x| x.map_or(f64::NAN, &number)).collect()
}

fn ten_to(scale: i8) -> f64 {
    10f64.powi(scale.into())
}

/// A time in parts of a second, s: the digits behind the point are not lost to the years before it.
pub(super) fn seconds(parts: i64, of_second: i64) -> f64 {
    parts.div_euclid(of_second) as f64 + parts.rem_euclid(of_second) as f64 / of_second as f64
}
